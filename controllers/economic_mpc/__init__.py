"""Economic model predictive control of any process: its economics and limits are arguments.

Map
---
controller.py         `EconomicMpc`: state in, decision out.
planner.py            From an estimate to a plan.
problem/              The optimal control problem of one plan.
solvers/              From a problem to a plan that holds.
softening.py          The order in which limits are given up.
scenarios.py          What may be otherwise than the estimate says.
tree/                 Plans whose first move keeps the limits in every scenario.
chance_constraint.py  Back-off from limits for what the estimate leaves open.
output_bias.py        Correction of the model by the last measured outputs.
early.py              Plans before their time.
modifiers/            Slopes of the plant where those of the model are wrong.
probing/              Moves that are made to learn.
taking_over.py        Going on from a smaller model.
told.py               What a decision tells of its plan.
state.py              `MpcState`: what the next decision needs.
"""

from controllers.economic_mpc.controller import EconomicMpc

__all__ = ["EconomicMpc"]
