"""What the commands of the command line do.

Map
---
runs/              Runs of a scenario for estimators, controllers and seeds; what they leave.
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
