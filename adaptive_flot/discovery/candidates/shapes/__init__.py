"""Shapes of a change that have a search of their own: they have local optima, and no curve draws them.

Map
---
step_events.py    Steps, ramps and washouts in time.
pulses.py         Changes that come and go, by the best pair of edges.
relays.py         Switches with two thresholds of a signal.
readings.py       Sensors that are read at even intervals, and kept in between.
limited_lines.py  Straight lines over a signal with kinks: limits and thresholds.
"""
