"""From the residual between a model and a measured record to the physical effect that the model lacks.

Map, in the order in which a record passes through it. Each folder imports only those above it.
----------------------------------------------------------------------------------------------
record/       The record as discovery sees it: screening, splits, measured outputs, noise.
fitting/      Fits of one alternative: unknowns, descent, likelihood, many at once.
assessment/   What a fit is worth: residual tests, verification on rows to which nothing was fitted.
candidates/   What could be missing: catalogue, first-order responses, the score test, step events, curves.
search/       Which combination it is: successive halving, rounds, joint search, common nuisance.
test_design/  Which input moves would tell the leading alternatives apart.
verdict/      The word, its reasons, and how it is told.
discover.py   The stages, one after the other.
"""
