"""Records of processes that are not flotation: `python -m benchmarks.other_processes generate|score`.

Each plant is simulated by its own code, and is richer than the model of about ten lines that its user has. Each record
has one effect that its model lacks, or none. A third of the records has a reference record of the same plant.

Map
---
world.py     One plant in one record: what it draws from, and how it is integrated.
process.py   What a process has: model, plant, cases and their true names.
mess.py      What sensors and archives do to a record: noise, quanta, outliers, holes.
plants/      The processes, a file each: the user's model, and the plant.
further/     Four more, which came last: each was judged before any rule knew it.
without_a_site/  Four with what their models have no site for.
record.py    Record k of a seed: its tables and its answer.
published/   Every verdict of a judged seed, with its commit.
score.py     Outcome of a verdict, and the figures.
__main__.py  `generate`, `discover`, `score`.
"""
