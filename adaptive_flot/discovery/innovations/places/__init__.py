"""Names beside what acts where the model has no site (see `discovery.further_sites`).

Map
---
row_by_row.py  What the innovations form tells.
constants.py   Fixed constants that do what is told, where they are off.
free_run.py    What a free run tells without a reference.
"""
