"""Batch prediction-error method: one fit to a whole record.

Map
---
estimator.py          Pem: the fit, from which starts, and its results.
free_runs.py          Errors of free runs, their derivatives, and the search from one start.
in_step.py            Searches of many records in step, as machine code.
free_runs_in_step.py  Their free runs.
trust_region.py       Their least squares.
problem.py            What is unknown: centre, scale and range.
starts.py             Scattered starts of a search.
"""

from estimators.pem.estimator import Pem

__all__ = ["Pem"]
