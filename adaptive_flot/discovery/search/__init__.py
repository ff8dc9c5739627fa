"""Which combination of candidates it is.

Map
---
search.py          Rounds of score, refit and compare.
rounds.py          One round, and the scores it starts from.
exchange.py        What else may stand in the place of an earlier effect.
alternatives.py    Which candidates are worth a full fit, and that fit.
halving/           Refits of these in rungs, the worse half left out of the next.
substance.py       Whether a further effect brings enough to be worth it.
mirrored.py        Lags of all inputs beside lags of all outputs.
simplify.py        A dependence that has become flat, tried as a constant.
joint_search.py    Several effects at once.
joint_fits.py      Fits of combinations from scattered starts.
common_nuisance.py Rivals compared with what all of them lack added to each.
"""
