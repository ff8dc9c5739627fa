"""Scenarios, the closed loop and what comes of a run. Each folder imports only those above it in this list.

Map
---
scenario/    What a scenario file says: keys, checks, frozen objects.
plants/      The simulated plant, a replayed record, faults between plant and controller.
loop/        The loop over the three contracts, and what its runs start from.
results/     What is taken from a run: time series, accounts, plans, the Cramer-Rao limit.
adaptation/  The model is extended while the loop runs.
commands/    What the commands of the command line do.
"""
