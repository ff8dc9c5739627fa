"""Joint extended Kalman filter of states and parameters, and what is worked out with it from a whole record.

Map
---
estimator.py     `Ekf`: the filter, as an estimator.
likely_drift.py  How fast the parameters drift, by maximum likelihood.
smoother.py      Rauch-Tung-Striebel smoother: estimates that know all samples.
"""

from estimators.ekf.estimator import Ekf, EkfState

__all__ = ["Ekf", "EkfState"]
