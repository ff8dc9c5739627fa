"""The loop.

Map
---
loop.py      Plant, estimator, controller: one sampling interval after the other.
prepared.py  What all runs of a scenario have in common, built once.
starts.py    Where the estimators start.
"""
