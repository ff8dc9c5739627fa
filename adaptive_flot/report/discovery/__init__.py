"""The report of `discover`.

Map
---
page.py         The page of one record: measured against model, curve of the effect, and the evidence.
records.py      The page of several records, or of records with a reference.
answer.py       The verdict and the sizes that belong to it.
tables.py       Tables and sentences.
charts.py       What each site and driver would explain; the curve of the effect: to point at.
figures.py      The same as figures that do not move, for notebooks; measured against model.
test_design.py  The test that would tell the leading alternatives apart.
"""
