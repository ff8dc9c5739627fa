"""How often a verdict is right.

Map, in the order in which a run is scored
------------------------------------------
commands.py  A discover command, or a rival, run on every record.
verdict.py   The verdict that it writes.
outcome.py   One verdict against one ground truth.
results.py   One row a record.
summary.py   Rates with intervals.
tables.py    A run, or several side by side, printed.
figures.py   From verdicts to figures, and files beside the run.
"""
