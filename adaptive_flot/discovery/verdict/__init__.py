"""What is told.

Map
---
verdict.py  One of six words, and what stands behind it.
wording.py  The verdict in plain words.
locate.py   Where in the process the missing effect acts.
curve.py    The curve of a fitted effect with its band.
"""
