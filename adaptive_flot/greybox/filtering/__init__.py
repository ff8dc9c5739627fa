"""A model in innovations form: process noise on its states, measurement noise on its outputs.

Map
---
noise_model.py  How large process and measurement noise are, and which parameters walk.
step.py         One interval of the extended Kalman filter as one compiled function.
filter.py       The filter over a whole record: innovations, their variances, the log-likelihood.
linearised.py   The same for other sizes of the noise, by the derivatives along one run.
smoother.py     The states and walking parameters given the whole record, with their standard deviations.
prediction.py   Errors k steps ahead of the filtered state.
likelihood.py   Parameters and noise by maximum likelihood.
cramer_rao_bound.py  Posterior Cramer-Rao bound: the smallest error that any estimator can have.
"""

from adaptive_flot.greybox.filtering.filter import Filtered, RecordFilter
from adaptive_flot.greybox.filtering.likelihood import InnovationsFit, maximise
from adaptive_flot.greybox.filtering.noise_model import NoiseModel
from adaptive_flot.greybox.filtering.prediction import prediction_errors
from adaptive_flot.greybox.filtering.smoother import Smoothed, smooth

__all__ = [
    "Filtered",
    "InnovationsFit",
    "NoiseModel",
    "RecordFilter",
    "Smoothed",
    "maximise",
    "prediction_errors",
    "smooth",
]
