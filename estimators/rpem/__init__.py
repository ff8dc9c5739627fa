"""Recursive prediction error method.

Map
---
estimator.py  `Rpem`: the recursion of the paper, and its options.
state.py      `RpemState`: what the next sample needs.
update.py     One update of estimate and covariance.
record.py     Many rows in one call, for replays.
ensemble.py   Many members at once.
full.py       `rpem_full`: the options that make it the full recursion.
"""

from estimators.rpem.estimator import Rpem
from estimators.rpem.full import rpem_full

__all__ = ["Rpem", "rpem_full"]
