"""Fits of one alternative to a record.

Map
---
base_fit.py          The record in splits, and the fit of the model as it is.
unknowns.py          What a fit is free to move.
descent.py           The search for one fit, with a noise model of its own.
normal_equations.py  Its linear problem along one run.
fitter.py            Fits to one problem.
fit.py               A fitted alternative and its criterion.
onsets.py            Whether an event begins at another time.
unseen_times.py      Times of events that no row that was fitted has seen.
running_off.py       Where a model leaves its own ranges.
step_length.py       Steps of the integration that are short enough for the record.
node_spacing.py      How far apart a densely sampled record may be simulated.
"""
