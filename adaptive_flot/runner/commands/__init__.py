"""What the commands of the command line do.

Map
---
run.py             Run a scenario for estimators, controllers and seeds.
side_by_side/      Runs of many seeds at once, where nothing that is decided depends on an estimate.
run_result.py      What one run leaves behind.
run_files.py       Files that a run writes.
runs_table.py      One row a run.
comparison.py      Controllers and estimators side by side.
fingerprint.py     What a scenario asks of its controllers: only like is compared with like.
estimate.py        A batch fit to a measured record, then a replay through each estimator.
innovations/       The same in innovations form: process noise, errors by horizon, smoothed states.
record_blocks.py   A record in two blocks: one to fit, one to test.
replay.py          Replay a record through one estimator.
estimate_files.py  Files that `estimate` leaves.
discover.py        Discovery on a file.
simulate.py        Simulate a table of inputs.
"""
