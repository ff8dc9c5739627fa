"""Refits of the candidates that score best, the worse half left out of the next rung.

Map
---
successive_halving.py  The rungs, one after the other.
rungs.py               What each rung fits, from what the earlier ones came to.
fit_jobs.py            One fit to be made: a form, an event, a constant, a freer or simpler profile.
"""
