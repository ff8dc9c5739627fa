"""What a fit is worth.

Map
---
detect.py             Whether the residual is more than noise, in which outputs, and since when.
holm.py               Several tests as one.
explained.py          Whether the inputs explain the outputs at all.
telling_rows.py       The rows that say anything of an event that passes.
verification.py       The error on rows to which nothing was fitted.
reduction.py          By how much an error is smaller, with its interval.
likelihood.py         What a difference of likelihood says.
swings.py             Whether an error swings with a period, where nothing has a name.
beside_background.py  What a background leaves unknown on rows that did not fit it.
"""
