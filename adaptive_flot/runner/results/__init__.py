"""What is taken from a run.

Map
---
run_arrays.py        What a run leaves behind, as arrays.
timeseries.py        One row an interval, and the fits that are taken from it.
accounts.py          How the inputs of a run were decided.
plans.py             What the controller expected.
replay_table.py      The table of a replay, and its errors.
whiteness.py         Are innovations white?
prediction.py        How well the models in use predicted.
cramer_rao_limit.py  The smallest error that any estimator could have.
"""
