"""The page of `import`: how good a record is, and what became of the export.

Map
---
page.py    The page: what follows, tables, pictures, the map.
series.py  What its figures are made of.
"""
