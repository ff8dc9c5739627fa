"""What a scenario file says, and what a seed draws from it.

Map
---
loading.py            Read a scenario file.
keys.py               The keys of the file.
inputs/               How inputs and parameters move over a run, and the random streams of it.
recorded_inputs.py    Read the record, or put a scenario on one.
faults.py             The entries of `faults`.
discovery_options.py  The key `discovery`.
scenario.py           A scenario as a frozen object.
checks.py             What one key alone does not show: times that do not fit, unknown names, ranges.
realisation.py        A scenario with one seed: everything of a run that nobody estimates or decides.
measurement_noise.py  Where and when outputs are measured, and the noise that is drawn for them.
disturbances.py       What acts beside the controller, and what instruments show of it, noise included.
"""
