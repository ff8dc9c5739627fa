"""Discovery in innovations form: a Kalman filter over the record, process noise for what always wanders.

The innovations say when something happened. A regression on what each family would do to them says what it may be. A
few effects are then fitted together, and judged on stretches that did not fit them.

Map
---
filter           The filter, fitted, and how its innovations answer.
courses.py       What each family would change at a site along a record.
events           When something was switched, or stuck.
screening.py     Which further effects are worth a refit.
search           A few effects together.
telling_apart.py Whether the record tells one explanation from another.
given_up.py      What draws only what is left of a wrong model.
told.py          What is said, as plain data.
late.py          Where a lag may be: lags in a row commute.
judge.py         What is certain, and what predicts rows that did not fit it.
in_words.py      What is told, in words.
places           Names beside what acts where the model has no site.
verdicts         What may be told of it, beside the free run or a comparison with a reference.
"""
