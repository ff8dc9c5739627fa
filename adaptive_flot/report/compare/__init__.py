"""Runs side by side.

Map
---
page.py          The page.
answer.py        Who earns or fits most, what it costs in limits, who decided.
findings.py      Sentences, each made from the numbers.
tables.py        The same cells for terminal, page and Markdown.
paired.py        Differences paired by seed, with intervals and wins.
trajectories.py  Time series over each other.
distribution.py  Distributions over the seeds.
contenders.py    The colour of each contender.
"""
