"""The test plant: a scenario behind an OPC UA server, with an operator's panel and a regulatory loop of its own.

Map
---
control.py  Who sets the inputs: local set-points or the link; limits, watchdog and hand-over. No input or output.
operator.py  A simulated operator for demonstrations.
process.py  The scenario's plant, one interval after the other, with the inputs that `control` lets act.
tags.py     Names, units and ranges of the tags, and who may write each.
users.py    User names and passwords, and the certificates that are trusted.
server.py   The OPC UA server.
serve.py    A test plant as a program.
link_text.py  A link file for it.
direct.py   The test plant without a network, for tests and benchmarks.
"""
