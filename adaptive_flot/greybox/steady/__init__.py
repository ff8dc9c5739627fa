"""Steady states.

Map
---
steady_state.py   Steady states and their sensitivities.
assumed_start.py  What is said of a record that does not start where its model assumes.
likely_unit.py    What is said of an output that is off by as much as another unit would make it.
linear.py         State space at an operating point (imports python-control: not part of the front).
"""
