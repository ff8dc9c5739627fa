"""Moves that are made to learn.

Map
---
choice.py       From the option `probing` to one of the two ways.
budget.py       Dips of an input, made while they are needed and paid for.
dips.py         A dip in front of a plan.
knowledge.py    The value of knowledge in the objective: detours that pay.
information.py  The covariance that a plan leaves.
stakes.py       What is lost by a wrong estimate.
"""
