"""What a fit is worth.

Map
---
detect.py        Whether the residual is more than noise, in which outputs, and since when.
holm.py          Several tests as one.
explained.py     Whether the inputs explain the outputs at all.
verification.py  The error on rows to which nothing was fitted.
"""
