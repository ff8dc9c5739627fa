"""What makes the link safe: pure functions of values, without input or output, so that a test can try every sequence.

Map
---
tag_value.py  A value as a server tells it: number, quality, source time.
checks.py     Which values count as measurements: status, age, range, jumps, frozen values.
limits.py     Clamps and rate limits of what is written.
modes.py      The modes off, monitor, advisory, closed and shed, as a state machine.
"""
