"""What every report is made of.

Map
---
page.py           The page: the answer, the chapters, how it was made.
parts.py          Tables, pictures, lists, headings.
album.py          Numbers the pictures; holds the data of those that move.
wording.py        Numbers and lists as text.
style.py          The look of figures that do not move; figures as data URIs.
figures.py        A chart as a figure that does not move.
strips.py         Which of a few states held when, for such a figure.
heat.py           A map of numbers, coloured, to point at.
residuals.py      Charts of residuals.
plotdata.py       What figures of many values are made of: frozen data.
distributions.py  Values over the seeds.
"""
