"""Measured tables.

Map
---
dataset.py     A record: read, checked, columns mapped to the names of a model.
columns.py     Columns of a table as numbers, times and dates.
stretches.py   Records with gaps.
lost_rows.py   Rows that a logger has lost.
repeated.py    Rows that a logger has written twice.
tables.py      Tables in CSV and Parquet.
wrong_unit.py  Values in another unit than their column says.
"""
