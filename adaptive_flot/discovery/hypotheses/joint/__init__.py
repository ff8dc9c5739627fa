"""One model fitted to several records at once, each with an initial state of its own.

Map
---
rows.py          Records, rows that count, usual sizes of errors, the criterion.
usual_errors.py  How large errors usually are, by where the plant is.
at_noise.py      Whether errors are noise, or the usual ones but for outliers.
known_before.py  Constants with their uncertainty, first guesses of initial states.
unknowns.py      Everything that a fit moves, as one vector with its bounds.
fit.py           The fit, by robust least squares.
"""
