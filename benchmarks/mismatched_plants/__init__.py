"""Closed loops with plants that differ from the controller's model: `python -m benchmarks.mismatched_plants`.

Map
---
plants.py    Thirty plants, drawn from seeds that were fixed before anything was tuned on them.
fastest.py   How soon the limit can be kept at all.
corner.py    What a right gradient could win at rest.
__main__.py  The command.
"""
