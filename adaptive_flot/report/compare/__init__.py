"""Runs side by side.

Map
---
page.py      The page.
findings.py  Sentences, each made from the numbers.
tables.py    The same cells for terminal, page and Markdown.
"""
