"""The report of scenario runs.

Map
---
page.py                 The page.
findings.py             Sentences, each made from the numbers of the runs.
tables.py               Fits, errors, innovations, statuses.
series.py               From runs to what the figures draw.
cramer_rao_limit.py     What the measurements say at best.
closed_loop.py          Operation, plans against what happened, who decided.
closed_loop_figures.py  Figures of the closed loop.
inquiries.py            Effects that were searched for while the loop ran.
fault_table.py          Faults that were injected.
unsolved.py             Optimisations without a valid solution.
"""
