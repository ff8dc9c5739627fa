"""The memory of the link: everything as it happens, one transaction a cycle.

Map
---
schema.py    The tables.
beside.py    What is stored beside a cycle: persons' actions, shadows, changes of the model.
memory.py    Open a database and store cycles.
rows.py      Rows of the tables that a cycle fills.
resume.py    Where a link goes on after a restart: estimate, model in use, the page's switch.
shadows.py   What ran in shadow beside what acted.
numbers.py   Arrays as text that comes back to the bit.
record.py    What was stored as a record that `discover`, `estimate` and `run` read, and as snapshots to replay.
"""
