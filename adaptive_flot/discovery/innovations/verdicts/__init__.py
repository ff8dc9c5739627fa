"""What the innovations form may tell: beside a free run, and beside a comparison with a reference.

Map
---
stretches.py       Errors on held-out stretches, each predicted from the state of the filter before it.
rivals.py          What the free run has, which a name of the innovations form must beat.
alternatives.py    What is told beside what the free run has and does not tell, both in innovations form.
common.py          One effect that every explanation has, alone where the rest stays open.
in_time.py         A dependence on what moves slowly, beside a change in time at the same site.
reach.py           Outputs that effects can change at all.
members.py         Members of a class as alternatives of a free run.
second_opinion.py  The stage of `discover` that asks, where the free run leaves too much.
telling.py         What it tells as a verdict, or the verdict of the free run that is kept.
event.py           An event in a record with a reference.
sole_cause.py      A cause that is certain alone, of explanations of two effects.
cause.py           A cause of the whole record, in one with a reference.
"""
