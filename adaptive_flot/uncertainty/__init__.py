"""What uncertain constants do to a simulation: quantile bands, and which constant matters most.

Map
---
ranges_file.py  The file of the ranges: a cell, and how far each uncertain constant may be off.
default_inputs.py  Inputs where no table of them is given.
draws.py        Draws of the constants, simulated side by side, and their quantiles.
ranking.py      Share of each constant in the variance of an output (Sobol' indices, by SALib).
"""
