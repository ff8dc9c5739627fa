"""Moving horizon estimation.

Map
---
estimator.py  `Mhe`: the estimator.
problem.py    The optimisation over one window.
arrival.py    The arrival cost: what the rows before the window said.
"""

from estimators.mhe.estimator import Mhe

__all__ = ["Mhe"]
