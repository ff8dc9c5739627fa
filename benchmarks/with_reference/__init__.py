"""Records of the flotation cell with a reference, to ask what has changed since.

The cell, its effects and its noise are those of `benchmarks.hidden_effects`, apart from the package. Of every four new
records three have an effect of ordinary size or more, and one has none. Each has a reference of its own: the same n and
C, other moves of the inputs, other noise, no effect.

record.py    A new record, its reference and its answer.
__main__.py  Command line: generate, judge, score.
published/   Results that the documentation cites.
"""
