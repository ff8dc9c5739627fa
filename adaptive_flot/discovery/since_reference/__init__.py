"""What has changed since a reference: hypotheses of the whole record, events, and effects of other shapes.

changes.py          What is called: the comparison first, then what it does not see.
process_noise.py    The new record in innovations form, by a model that has what the reference lacks too.
searched_change.py  Effects of other shapes and two effects, by the search of a single record with constants held.
not_new.py          What is no change: it is on the reference as well, or may be what wanders.
supported.py        Whether the innovations form has any use for what free runs tell.
step.py             One step at a site that alone leaves the usual errors, where nothing else is told.
places.py           What acts where the model has no site: said first where nothing is told at one, else a note.
taken_back.py       When what is told is taken back: it leaves too much, or another form contradicts it.
"""
