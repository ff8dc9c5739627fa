"""Records and their ground truth.

Map, in the order in which a record is made
-------------------------------------------
schedule.py      Which record is what.
draw.py          Random experiments and effects.
nominal_fit.py   The cell without the effect, fitted.
sizing.py        How large an effect is.
ground_truth.py  What is hidden in a record, and which verdicts are right.
categories.py    The seven categories of records.
record.py        Record k of a seed: its table and its ground truth.
folder.py        Records of a seed in a folder.
"""
