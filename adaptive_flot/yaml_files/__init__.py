"""YAML files that somebody wrote.

Map
---
read.py      Read one: plain values only, each key once, of a size that a person could write.
part.py      A part of one, as pydantic checks it.
problems.py  What pydantic says of one, in one line.
"""
