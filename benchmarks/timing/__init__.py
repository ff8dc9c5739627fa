"""How fast it is, each beside another way that is timed in the same run: `make bench`, `make bench-lanes`.

Map
---
speed.py             Simulation and estimation, beside SciPy.
solve_times.py       The economic MPC in closed loop, solver beside solver.
lanes.py             Many members side by side, beside SciPy and JAX.
short_runs.py        Short runs, beside a function of so many intervals.
filter_steps.py      The filter of a record, beside its steps as one function and without derivatives along a run.
scaling.py           Whether an update costs more the longer a record is.
throughput.py        Runs of a study a second.
report_pages.py      How soon a page shows its first chart.
scipy_reference.py   The paper's study in plain SciPy: reference of tests and times.
do_mpc_reference.py  The same optimal control problem in do-mpc.
jax_step.py          The step of the cell in JAX.
"""
