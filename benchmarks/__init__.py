"""What is measured of this package, by commands of their own. Nothing in the package imports this.

Map
---
__main__.py         The table of speed: `make bench`.
timing/             How fast it is, beside SciPy, JAX and do-mpc.
estimation/         Estimators: accuracy, honesty, forgetting, excitation.
kinds_of_change/    Estimators: every kind of change, and models that are a little wrong.
control/            Controllers in closed loop, and what knowledge is worth.
mismatched_plants/  Controllers on thirty plants that their model does not know.
live/               The live link under faults.
hidden_effects/     Discovery on 300 flotation records with an effect that nobody declared.
with_reference/     ... the same since a reference.
plant_like/         ... on flotation records as plants have them: gaps, outliers, a wandering feed.
other_processes/    Discovery on simulated records of processes that are not flotation.
real_records/       Discovery on measured records.
pictures/           Pictures and tables of README and docs.
"""
