"""Interacting multiple models.

Map
---
estimator.py  `Imm`: the estimator.
modes.py      Which parameter moves in which mode, and how modes follow one another.
mixing.py     The mixing of states between modes.
"""

from estimators.imm.estimator import Imm

__all__ = ["Imm"]
