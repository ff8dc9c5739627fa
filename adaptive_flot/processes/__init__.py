"""First-principles models built on the grey-box engine.

Map
---
registry.py        Processes by name; what a command line or a scenario names becomes a model.
process.py         What the registry knows of a shipped process.
flotation/         A flotation cell: pulp, froth, level loop; described by a cell file.
cascaded_tanks.py  Two tanks under a pump: a published benchmark.
zinc_level.py      Level of an industrial zinc cell under feedback.
iron_columns.py    Flotation columns of an iron ore plant.
model_file.py      Model files: a process, its parameters and further effects.
model_writer.py    Write a model as a model file.
effect_entry.py    An effect as model files and scenarios write it.
"""
