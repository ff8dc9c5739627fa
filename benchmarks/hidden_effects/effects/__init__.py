"""What may be hidden in a record.

Map
---
curves.py     Shapes over a driver, and over time.
spec.py       An effect as plain data, and how it becomes a factor in the cell.
catalogue.py  Listed sites and drivers, and other names of the same thing.
beyond.py     Effects at no listed site.
"""
