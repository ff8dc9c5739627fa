"""The live link: a scenario's estimator and controller beside a running plant, over OPC UA.

Map
---
safety           What must hold whatever happens: checks of values, limits, modes. Pure functions.
link_keys        The parts of a link file.
link_file        A link file with the scenario that it names.
map_tags         Tags of it that the map of an import gives.
certificates     Certificates, keys, passwords and tokens.
snapshot         What the plant told by the begin of a cycle.
outcome          What a cycle came to.
requests         What persons ask for, on its way to the loop.
alarms           Raised, acknowledged, cleared.
finding          What discovery found.
store            The memory: a database, and records and replays from it.
link             The cycle, and the OPC UA client.
plant            The test plant: a scenario behind an OPC UA server.
shadow           Other estimators, controllers and models on the same samples, in processes of their own.
running          The loop, and what it does beside its cycles.
page             The page of the control room.
program          A link as a program.
demo             `make live-demo`.

A cycle goes: `Desk.answer` -> `PlantClient.snapshot` -> `Cycle.step` -> `Memory.store` -> `PlantClient.tell` and
`write`. Page and shadows are told afterwards, and nobody waits for them.
"""
