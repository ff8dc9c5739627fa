"""The live link: a scenario's estimator and controller beside a running plant, over OPC UA.

Map
---
safety           What must hold whatever happens: checks of values, limits, modes. Pure functions.
link_file        The keys of a link file.
certificates     Certificates, keys and passwords.
snapshot         What the plant told by the begin of a cycle.
outcome          What a cycle came to.
store            The memory: a database, and records and replays from it.
link             The cycle, the OPC UA client, and the loop around them.
plant            The test plant: a scenario behind an OPC UA server.

A cycle goes: `PlantClient.snapshot` -> `Cycle.step` -> `Memory.store` -> `PlantClient.tell` and `write`.
"""
