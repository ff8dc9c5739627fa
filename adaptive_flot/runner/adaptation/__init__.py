"""The model is extended while the loop runs.

Map
---
supervision.py        The supervisor of a run, where its scenario asks for one.
supervisor.py         Watches the loop, searches for a cause, extends the model.
whiteness_watch.py    Are innovations still white?
inquiry.py            What came of one alarm.
measured_record.py    The record of a running loop, as a search is given it.
search.py             A search of it for what the model lacks.
extension.py          What a search found, as a change of the model in use.
bumpless_transfer.py  The running loop goes over to the extended model without a bump.
background.py         A function in a process of its own.
"""
