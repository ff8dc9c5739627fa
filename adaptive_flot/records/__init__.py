"""From a plant's export to a record: tags, units, times, gaps, and how good the record is.

Map
---
tag_map.py    The map from tags to quantities of a model (YAML), which the live link reads too.
map_values.py  Durations, units, zones and codes in it, checked as they are read.
units.py      Units and durations as plants write them.
reading/      From bytes to signals.
guess.py      Which tag measures which quantity, and in what unit.
habits.py     Step, holes, codes, repeats and spikes, by how a signal behaves.
clean.py      Values of a tag to those of a quantity.
grid.py       Values at their own times to rows.
importing.py  `import_table`: all of it in order.
described.py  What was done, in words.
quality/      How good the record is, and what can be identified from it.
"""
