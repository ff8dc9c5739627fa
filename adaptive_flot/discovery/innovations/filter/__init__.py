"""A Kalman filter over a record, fitted: how its innovations answer, and how large the noise is.

Map
---
linear_response.py  How the innovations answer to what happens at a site.
noise_fit.py        How large process and measurement noise are.
refit.py            A model with effects, fitted.
thinning.py         A long record with fewer rows.
"""
