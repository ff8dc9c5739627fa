"""A Kalman filter over a record, fitted: how its innovations answer, and how large the noise is.

Map
---
free_parameters.py  The free parameters of a fit, what is known of them before, and steps that stay in range.
linear_response.py  How the innovations answer to what happens at a site.
noise_fit.py        How large process and measurement noise are.
refit.py            A model with effects, fitted.
thinning.py         A long record with fewer rows.
"""
