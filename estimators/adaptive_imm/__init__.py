"""Interacting multiple models for every kind of change, with noise, outliers and errors of the model itself.

Map
---
estimator.py     `AdaptiveImm`: the estimator.
state.py         What one step hands to the next.
options.py       Checks of the options.
trust.py         What the first record's fit says of the model, and where the filter starts then.
disturbances.py  Disturbances that nobody measures, as further parameters.
modes.py         The modes, and how the process goes from one to another.
interval.py      Prediction over an interval, linearised at a lagged estimate of the parameters.
bank.py          Mixing, correction, combination and noise level of the filters, as expressions over all modes.
ensemble.py      Records of many members at once.
step.py          One interval of it all as one compiled function.
region.py        How wide the covariance of the parameters is shown.
"""

from estimators.adaptive_imm.estimator import AdaptiveImm

__all__ = ["AdaptiveImm"]
