"""What acts where a model has no site: places for it, their words, and what says the same at a site of the model.

Before a part gets a name, each of these places competes with it. Where one explains the record surely better, the model
has no place for what has changed.

Map
---
places.py        The model with further sites: at balances, rates, inputs, and beside factors.
wording.py       What acts at such a place, in words.
same_meaning.py  What says the same at a site of the model.
"""
