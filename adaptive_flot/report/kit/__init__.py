"""What every report is made of.

Map
---
page.py           Tables, numbered figures, a template, and how a page was made.
style.py          The look of figures; units of axis labels; figures as data URIs.
plotdata.py       What figures are made of: frozen data.
figures.py        Data in, figure out.
strips.py         Which of a few states held when.
distributions.py  Values over the seeds.
"""
