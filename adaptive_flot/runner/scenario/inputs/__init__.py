"""How inputs and parameters of a scenario move.

Map
---
profiles.py        How they move over a run.
recorded.py        An input as it was recorded at a plant.
random_streams.py  The random streams of a run, by name.
"""
