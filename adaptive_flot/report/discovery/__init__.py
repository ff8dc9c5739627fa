"""The report of `discover`.

Map
---
page.py         The page: verdict, residual, evidence, effect, error before and after.
tables.py       Tables and sentences.
figures.py      What each site and driver would explain; the curve of the effect.
test_design.py  The test that would tell the leading alternatives apart.
"""
