"""From a plant's export to a record: tags, units, times, gaps, and how good the record is.

Map
---
tag_map.py  The map from tags to quantities of a model (YAML), which the live link reads too.
units.py    Units and durations as plants write them.
"""
