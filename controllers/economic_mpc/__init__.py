"""Economic model predictive control.

Map
---
controller.py           `EconomicMpc`: state in, decision out.
layout.py               Where each unknown stands in the vector of the optimisation.
stage.py                One stage: dynamics, cost, constraints.
collocation.py          The dynamics over one move as equations.
condensing.py           States eliminated.
derivatives.py          Derivatives of the problem, stage by stage.
nlp_solvers.py          The solvers and their options.
real_time_iteration.py  One iteration a sample.
verification.py         No solution is used that a simulation does not confirm.
softening.py            Constraints that can not be met at the start are softened.
grade_bias.py           Correction of the model by the last measured grade.
feed_forward.py         Disturbances that are measured.
probing.py              Moves that are made to learn.
"""

from controllers.economic_mpc.controller import EconomicMpc

__all__ = ["EconomicMpc"]
