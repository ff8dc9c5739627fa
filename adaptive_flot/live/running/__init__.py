"""The loop of the link, and what it does beside its cycles.

Map
---
run.py       The loop: requests, snapshot, cycle, storage, writes.
desk.py      What persons ask for, alarms, shadows, and the card of discovery.
model_use.py The model in use: extended and reverted between two cycles.
progress.py  What a cycle looks like from outside.
watchdog.py  Ends a program whose cycle does not end.
"""
