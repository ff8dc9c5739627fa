"""What is said of a record.

Map
---
judge.py        One of six words, from the ranked alternatives.
idle_effects.py An effect that adds nothing to the others is not told.
one_course.py   Changes with one course in time are one cause, and no name is told.
certain_part.py A part that is certain, where the whole is not told.
heed_report.py  The stage in which the report rows have their say.
at_noise.py     The stage that says `none` where errors are noise and no name is told.
large_drift.py  The stage in which a large drift that nobody expects is no longer `none`.
report_veto.py  What held-out rows contradict is not told as a name.
outputs.py      What is certain output by output where the record is not told.
conclude.py     The verdict: that word with errors, tests, intervals and reasons.
locate.py       Where in the process the missing effect acts.
words/          The verdict as a user reads it: words, sizes, curves.
"""
