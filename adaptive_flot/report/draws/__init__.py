"""The page of `simulate --draws`: what uncertain constants do to grade and recovery.

Map
---
page.py     The page.
figures.py  Bands over time, and shares of the variance.
"""
