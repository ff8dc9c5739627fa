"""One sampling interval, and many.

Map
---
stepper.py    One interval as a compiled function: next state, outputs and their sensitivities.
fast_step.py  The same in fewer operations, where the model allows.
compiled.py   Machine code with the system's C compiler, and its cache.
fastcall.py   Calls of a compiled function without copies.
recursion.py  Many intervals in one call.
nodes.py      A densely sampled record in longer intervals.
rows.py       Rows of a record in blocks.
record.py     Free runs over a record.
"""
