"""Which input moves would tell the leading alternatives apart.

Map
---
signals.py     Candidate test signals, inside limits.
separation.py  How far apart two fitted models are in a test.
experiment.py  The test with the largest separation.
"""
