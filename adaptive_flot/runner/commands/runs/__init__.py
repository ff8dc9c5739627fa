"""Runs of a scenario.

Map
---
run.py         Run a scenario for estimators, controllers and seeds.
side_by_side/  Runs of many seeds at once, where nothing that is decided depends on an estimate.
run_result.py  What one run leaves behind.
run_files.py   Files that a run writes.
runs_table.py  One row a run.
"""
