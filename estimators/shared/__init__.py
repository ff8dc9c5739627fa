"""What several estimators use.

Map
---
joint_filter.py      Extended Kalman filter of state and parameters together.
drift.py             How far parameters drift within an hour, as an option gives it.
coordinates.py       Scaled parameters and their bounds.
outliers.py          Outliers among the errors of a fit.
colour.py            How far the errors of a fit are from white noise.
information.py       Directions of the parameters on which the last rows say too little.
measured.py          Which outputs of a sample are there.
ensemble.py          Samples of many members at once.
state_correction.py  Correction of the state by measured outputs.
"""
