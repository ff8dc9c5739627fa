"""What a scenario file says.

Map
---
scenario.py           A scenario, validated once into frozen objects.
keys.py               The keys of the file.
checks.py             What one key alone does not show: times that do not fit, unknown names, ranges.
profiles.py           How inputs and parameters move over a run.
faults.py             The entries of `faults`.
discovery_options.py  The key `discovery`.
"""
