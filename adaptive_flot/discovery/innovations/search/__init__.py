"""Which effects explain a record, in innovations form.

Map
---
explanation.py  Effects that explain a record together, and what they are worth.
search.py       A record, and what is asked of it: fits and regressions.
least_shown.py  How small a change the record shows.
beam.py         The explanations, found effect by effect.
turned_over.py  Events that are there from the first row on.
pauses.py       What is short of an event that lasts: a pause, or a blip.
walking.py      Whether an event that comes again and again is a quantity that wanders.
"""
