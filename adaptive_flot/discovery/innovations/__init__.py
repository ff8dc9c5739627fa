"""Discovery in innovations form: a Kalman filter over the record, process noise for what always wanders.

The innovations say when something happened. A regression on what each family would do to them says what it may be. A
few effects are then fitted together, and judged on stretches that did not fit them.

Map
---
linear_response.py  How the innovations answer to what happens at a site.
courses.py          What each family would change at a site along a record.
switching.py        When something was switched on and off.
halting.py          When a part did not follow what it was asked.
screening.py        Which further effects are worth a refit.
noise_fit.py        How large process and measurement noise are.
refit.py            A model with effects, fitted.
thinning.py         A long record with fewer rows.
search.py           A few effects together.
pauses.py           Events that stop for short pauses only.
telling_apart.py    Whether the record tells one explanation from another.
judge.py            What is certain, and what predicts rows that did not fit it.
in_words.py         What is told, in words.
places              Names beside what acts where the model has no site.
verdicts            What may be told of it, beside the free run or a comparison with a reference.
"""
