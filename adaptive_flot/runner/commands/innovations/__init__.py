"""A record in innovations form: what `estimate` adds where a record asks for process noise.

Map
---
estimate.py   Fit the fit block, filter and smooth both blocks, errors by horizon.
form.py       A fitted model in innovations form: which noise predicts best, what becomes of a record.
"""
