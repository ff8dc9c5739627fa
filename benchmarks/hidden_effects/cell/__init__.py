"""The laboratory cell once more, from the published page: a second copy that shares nothing with the package.

Map
---
constants.py  Published constants of the cell.
sites.py      Names and indices of sites, drivers, inputs and outputs.
equations.py  Right-hand side of the cell.
simulate.py   Integration by SciPy's LSODA.
"""
