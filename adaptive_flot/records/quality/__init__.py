"""How good a record is, and what can be identified from it.

Map
---
quality.py     `judge`: all of it together, and what follows, in words.
signals.py     Each signal: availability, holes, frozen stretches, spikes, spread, noise, drift.
excitation.py  Each input: does it move, and how richly.
relations.py   Pairs: correlation, and whether an input is set from an output (closed loop).
"""
