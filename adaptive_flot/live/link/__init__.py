"""The link: one cycle an interval, from what the plant tells to what is written.

Map
---
samples.py    From checked values to a sample.
cycle.py      One cycle: check, estimate, decide, mode, limits. A function of snapshot and state: it can be replayed.
estimation.py The estimator over gaps and restarts.
discovery.py  Watches the innovations, searches for a cause, applies nothing.
children.py   Processes beside the cycles end with the link, and run behind it.
client.py     The OPC UA client: reads by subscription, writes and reads back, never waits without end.
told.py       The newest value of each subscribed tag, as a snapshot.
replay.py     A stored session once more, compared to the bit.
"""
