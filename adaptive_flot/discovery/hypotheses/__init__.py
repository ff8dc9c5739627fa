"""Named hypotheses, fitted to several records at once and judged on stretches that did not fit them.

It serves where one record alone is not enough: what has changed since a reference record, and several records of one
process together. Nothing is fitted across the border of two records.

Map
---
procedure.py         The stages: constants, model as it is, hypotheses, judgement.
calibration.py       Constants, usual sizes of the errors and the ranges of the sites, from the reference records.
families.py          What can be the matter at a site, by its role.
seen.py              What was seen at every site along the runs of a fit.
joint/               One model fitted to several records, each with an initial state of its own.
cross_validation.py  A hypothesis fitted to some stretches and judged on the others.
comparison.py        Which hypotheses stand on fresh rows, and which the records can not tell apart.
plausible.py         Whether a fitted fault can be what it says.
without_a_site.py    What is told, beside what acts where the model has no site.
judgement.py         From these to a word.
telling.py           The verdict.
wording.py           A hypothesis in words: size, direction, unit.
"""
