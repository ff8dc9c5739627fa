"""What is always a little wrong with a model: a feed that wanders, and constants that are known to some per cent.

A free run has no place for either. So they are bent into effects that are not there: a curve in time at any site that
acts on the same output, or whichever constant makes up best for all.

Map
---
linear.py       Its linear responses along a run: lines of a course, uncertain constants.
evidence.py     Marginal likelihood of its numbers, to first order.
spread.py       Whether there is one, and its numbers, beside the effects that explain more.
fitting.py      The fit that has it, linearised anew; whether a fit needs it.
renewed.py      Its numbers once more, beside the best effect.
two_courses.py  A second course beside that of the feed: its site, and the numbers of both.
told_course.py  What wanders at a site as an alternative, where nothing else is told.
wording.py      What is told of it.
"""
