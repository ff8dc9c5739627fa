"""A verdict in words and numbers that a user reads.

Map
---
wording.py      The verdict in one paragraph.
sizes.py        An effect that is told: what, by how much, in which direction and when.
curve.py        The curve of a fitted effect with its band.
thresholds.py   How far the thresholds of a switch may lie from where they were fitted.
suspects.py     Events that seem to begin where a sensor says nothing.
"""
