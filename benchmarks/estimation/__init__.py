"""How accurate and how honest estimators are, and why.

Map
---
accuracy.py           Every estimator over many seeds.
paper_study.py        Why the printed RPEM stays below the published fits.
excitation.py         What the inputs let an estimator know.
forgetting.py         How RPEM should forget.
likely_drift.py       What the first record tells of a later drift.
state_correction.py   What correcting the state by further outputs is worth.
undeclared_effect.py  What RPEM absorbs of an effect that no model has.
"""
