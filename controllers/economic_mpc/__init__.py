"""Economic model predictive control of any process: its economics and limits are arguments.

Map
---
controller.py           `EconomicMpc`: state in, decision out.
planner.py              From an estimate to a plan.
softening.py            The order in which limits are given up.
taking_over.py          Going on from a smaller model.
told.py                 What a decision tells of its plan.
state.py                `MpcState`: what the next decision needs.
layout.py               `StageLayout`: where each unknown stands in the vector of the optimisation.
stage.py                One stage: dynamics, what is earned, constraints.
collocation.py          The dynamics over one move as equations.
condensing.py           States eliminated.
derivatives.py          Derivatives of the problem, stage by stage.
nlp_solvers.py          The solvers and their options.
real_time_iteration.py  One iteration a sample.
newton_step.py          The iteration of one plan.
verification.py         No solution is used that a simulation does not confirm.
scenarios.py            What may be otherwise than the estimate says.
scenario_tree.py        The tree of scenarios as one NLP.
tree_layout.py          Where each stage of a tree stands in its vectors.
tree_step.py            The iteration of a tree.
tree_programme.py       Its quadratic programme.
tree_planner.py         Plans whose first move keeps the limits in every scenario.
chance_constraint.py    Back-off from limits for what the estimate leaves open.
output_bias.py          Correction of the model by the last measured outputs.
early.py                Plans before their time.
dips.py                 A dip in front of a plan.
probing.py              Dips of an input that tell parameters apart.
"""

from controllers.economic_mpc.controller import EconomicMpc

__all__ = ["EconomicMpc"]
