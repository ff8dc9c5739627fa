"""Every kind of change, and models that are a little wrong: `python -m benchmarks.kinds_of_change`.

Map
---
truths.py    The twelve truths, as edits of two shipped scenarios.
best_fit.py  The best-fitting parameters where the model has no true ones.
figures.py   Fits, and the share of the time in which the 95 % region holds the truth.
cost.py      What an update costs.
__main__.py  The command.
"""
