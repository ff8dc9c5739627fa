"""Records of the laboratory cell as a plant would give them, 8 h at 10 s: `python -m benchmarks.plant_like`.

The cell, the effects and the score are those of `benchmarks.hidden_effects`. What is different is the rest: several
constants of the cell are not what the model has, the feed grade wanders, noise has a memory, rows are missing, and some
are outliers.

Map
---
background.py   What is wrong on every record: constants, feed, noise, gaps.
draw.py         Moves of an operator, and the effect of a record.
record.py       Record k of a seed: its table and its answer.
score.py        Outcome of a verdict, and the figures.
sizes.py        Sizes of constants that are named rightly.
limit.py        What can be told at all: the gain of the effect when it is given.
__main__.py     `generate`, `score`, `limit`.
"""
