"""What several estimators use.

Map
---
joint_filter.py      Extended Kalman filter of state and parameters together.
smoother.py          Rauch-Tung-Striebel smoother of the same.
drift.py             How fast parameters are believed to drift, by maximum likelihood.
coordinates.py       Scaled parameters and their bounds.
information.py       Directions of the parameters on which the last rows say too little.
measured.py          Which outputs of a sample are there.
state_correction.py  Correction of the state by measured outputs.
"""
