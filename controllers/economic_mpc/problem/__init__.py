"""The optimal control problem of one plan.

Map
---
layout.py       `StageLayout`: where each unknown stands in the vector of the optimisation.
stage.py        One stage: dynamics, what is earned, constraints.
collocation.py  The dynamics over one move as equations.
condensing.py   States eliminated.
derivatives.py  Derivatives of the problem, stage by stage.
"""
