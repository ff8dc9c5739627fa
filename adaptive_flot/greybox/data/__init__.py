"""Measured tables.

Map
---
dataset.py  A record: read, checked, columns mapped to the names of a model.
tables.py   Tables in CSV and Parquet.
"""
