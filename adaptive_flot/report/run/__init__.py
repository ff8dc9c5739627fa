"""The report of scenario runs.

Map
---
page.py                 The page.
answer.py               The answer in open loop; in closed loop it is that of `compare`.
chapter.py              What is told of one scenario and controller, topic by topic.
findings.py             Sentences, each made from the numbers of the runs.
absorbed.py             Parameters that take up what the model lacks.
tables.py               Fits, errors, innovations, statuses.
series.py               From runs to what the figures draw.
pictures.py             Charts of inputs, parameters, outputs, residuals.
cramer_rao_limit.py     What the measurements say at best.
control/                Operation, plans, limits that no plan kept, optimisations that failed.
inquiries.py            Effects that were searched for while the loop ran.
fault_table.py          Faults that were injected.
"""
