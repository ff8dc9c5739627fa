"""The link: one cycle an interval, from what the plant tells to what is written.

Map
---
snapshot.py   What the plant told by the begin of a cycle.
cycle.py      One cycle: check, estimate, decide, mode, limits. A function of snapshot and state: it can be replayed.
estimation.py The estimator over gaps and restarts.
client.py     The OPC UA client: reads by subscription, writes and reads back, never waits without end.
run.py        The loop: snapshot, cycle, storage, writes.
"""
