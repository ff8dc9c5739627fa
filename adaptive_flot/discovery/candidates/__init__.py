"""What could be missing.

Map
---
catalogue.py    For each site and driver, what scores it and what is fitted.
variant.py      One way to score and fit a candidate.
responses.py    How outputs respond to a small change at each site.
score_test.py   The efficient score statistic of every candidate.
spline.py       Free curves over a driver.
knots.py        Knots that a curve does not need.
dynamics.py     Sensors that respond late; actuators that follow late, stick or reach a limit.
turns.py        What turns with the sign of a signal, as dry friction does.
direction.py    Which way a physical cause goes.
shapes/         Events, pulses, switches, lines with kinks: shapes that have a search of their own.
"""
