"""Refits of the candidates that score best, the worse half left out of the next rung.

Map
---
successive_halving.py  The rungs, one after the other.
refits.py              What all rungs of a refit share, and how one is run.
jobs.py                One fit to be made, and what it came to.
first_rungs.py         Everyone with a few steps, then the finalists to the end.
restarts.py            Fits that rested in a wrong place, from what another came to.
events.py              Events in time and lines with kinks, from fitted curves.
constants.py           The constant that a dependence may have come to.
late.py                Sensors that are read at intervals.
freedom.py             Time profiles with more freedom, and curves with less.
"""
