"""Estimators: plug-ins that the core knows by address only.

Map
---
fixed.py       Constant parameters: the baseline.
oracle.py      Knows the true parameters: the upper limit of any comparison.
rpem/          Recursive prediction error method, as printed and in full.
ekf/           Extended Kalman filter of state and parameters, its likely drift, its smoother.
imm/           Interacting multiple models: rest, drift and jump.
adaptive_imm/  Interacting multiple models for every kind of change, with outliers, noise level and model error.
mhe/           Moving horizon estimation.
pem/           Batch prediction error method: one fit to a whole record.
shared/        What several of them use: joint filter, drift, coordinates, state correction.
"""
