"""Which input moves would tell the leading alternatives apart.

Map
---
movable.py     Which inputs a test may move.
signals.py     Candidate test signals, inside limits.
separation.py  How far apart two fitted models are in a test.
power.py       How often a test would tell the right one, by simulation.
experiment.py  The test with the largest separation.
"""
