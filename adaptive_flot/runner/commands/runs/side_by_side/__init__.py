"""Runs of many seeds at once: plants and estimators in lanes, where nothing that is decided depends on an estimate.

Map
---
runs.py    Which runs may go side by side, and these runs.
plants.py  Their plants, before any estimator.
"""

from adaptive_flot.runner.commands.runs.side_by_side.runs import can_go_side_by_side, run_side_by_side

__all__ = ["can_go_side_by_side", "run_side_by_side"]
