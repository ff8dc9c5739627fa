"""The front door for Python: one function a task, each with a result that shows, plots, reports and saves itself.

Map
---
runs.py         `run`, and its result `Runs`.
estimation.py   `estimate`, and its result `Estimation`.
finding.py      `discover`, and its result `Finding`.
simulation.py   `simulate`, and its result `Simulation`.
models.py       A model from what the user gave: a `Model`, a name, or the address of a file.
plugins.py      Estimators and controllers from names, classes, and classes with options.
records.py      A record from a file, a table, or a record at hand.
shown.py        Tables as notebooks show them; the kinds of a plot.
"""

from adaptive_flot.api.estimation import Estimation, estimate
from adaptive_flot.api.finding import Finding, discover
from adaptive_flot.api.runs import Runs, run
from adaptive_flot.api.simulation import Simulation, simulate

__all__ = ["Estimation", "Finding", "Runs", "Simulation", "discover", "estimate", "run", "simulate"]
