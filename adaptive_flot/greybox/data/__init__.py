"""Measured tables.

Map
---
dataset.py       A record: read, checked, columns mapped to the names of a model.
columns.py       Columns of a table as numbers, times and dates.
stretches.py     Records with gaps.
lost_rows.py     Rows that a logger has lost.
repeated.py      Rows that a logger has written twice.
tables.py        Tables in CSV and Parquet.
swapped.py       Two columns that may have each other's values.
value_checks.py  Whether what is in the columns can be what they are called.
wrong_unit.py    Values in another unit than their column says.
"""
