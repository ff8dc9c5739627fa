"""The report of `estimate`: a measured record replayed through estimators.

Map
---
page.py    The page.
answer.py  Who predicts rows that fitted nothing best, and by how much.
series.py  From a replayed record to what the figures draw.
"""
