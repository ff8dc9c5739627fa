"""From a problem to a plan that holds.

Map
---
nlp_solvers.py          The solvers and their options.
real_time_iteration.py  One iteration a sample.
newton_step.py          The iteration of one plan.
verification.py         No solution is used that a simulation does not confirm.
"""
