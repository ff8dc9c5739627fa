"""One sampling interval, and many.

Map
---
step_functions.py  The compiled functions of one interval: the step, its derivatives, many in a row.
stepper.py    Simulation of a record, with or without sensitivities.
trajectory.py What a simulation returns.
fast_step.py  The same in fewer operations, where the model allows.
in_steps.py   The steps of an interval as a loop, for filters: a function that is short however many there are.
compiling/    Machine code with the system's C compiler, its cache, and calls without copies.
recursion.py  Many intervals in one call.
nodes.py      A densely sampled record in longer intervals.
graded_nodes.py  A coarsely sampled one in short steps after a move, and long ones at rest.
rows.py       Rows of a record in blocks.
row_jacobians.py Jacobians of the step in every row of a run.
linear_run.py Responses of a linearised run to many profiles at once.
whole_record/ A whole record in one call of machine code, with derivatives.
record.py     Free runs over a record.
"""
