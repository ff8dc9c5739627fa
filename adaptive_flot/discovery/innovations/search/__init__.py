"""Which effects explain a record, in innovations form.

Map
---
explanation.py  Effects that explain a record together, and what they are worth.
search.py       A record, and what is asked of it: fits and regressions.
beam.py         The explanations, found effect by effect.
"""
