"""What the command line prints.

Map
---
lines.py   Tables on standard output, a progress bar on standard error.
study.py   What `sweep` prints at its end.
tables.py  Tables that are too wide become several below each other.
"""
