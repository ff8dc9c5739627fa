"""Slopes of the plant where those of the model are wrong: modifier adaptation.

Map
---
slopes.py       Slopes of model errors by inputs, from pairs of changes.
learning.py     `Modifiers`: from samples and estimates to what is added to the model's outputs.
"""
