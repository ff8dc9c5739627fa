"""What is said of a record.

Map
---
judge.py        One of six words, from the ranked alternatives.
idle_effects.py An effect that adds nothing to the others is not told.
certain_part.py A part that is certain, where the whole is not told.
heed_report.py  The stage in which the report rows have their say.
report_veto.py  What held-out rows contradict is not told as a name.
outputs.py      What is certain output by output where the record is not told.
conclude.py     The verdict: that word with errors, tests, intervals and reasons.
suspects.py     Events that seem to begin where a sensor says nothing.
wording.py      The verdict in plain words.
sizes.py        An effect that is told: what, by how much, in which direction and when.
locate.py       Where in the process the missing effect acts.
curve.py        The curve of a fitted effect with its band.
thresholds.py   How far the thresholds of a switch may lie from where they were fitted.
"""
