"""Records with an effect the cell model lacks, their answers, and the score of whoever tries to find it.

A package apart: it shares no equation, constant, integrator or effect form with `adaptive_flot`, so that what it says
of `adaptive-flot discover` can not flatter it. See README.md beside this file.
"""
