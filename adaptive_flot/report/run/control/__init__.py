"""What the report of runs says of a controller.

Map
---
closed_loop.py          Operation, plans against what happened, who decided.
closed_loop_figures.py  Charts of the closed loop.
softened.py             Limits that no plan kept.
unsolved.py             Optimisations without a valid solution.
"""
