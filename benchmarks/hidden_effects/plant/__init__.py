"""What stands around the cell in an experiment.

Map
---
excitation.py  Moves of the inputs in open loop.
control.py     PI, and a predictive controller that adapts.
sensors.py     Sensor effects, noise and faults, row by row.
noise.py       Measurement noise of six kinds.
experiment.py  One experiment, run with or without effects.
"""
