"""Forms of an effect: how a coefficient and a driver act on the value at a site.

Map
---
form.py     What a form is.
static.py   Forms without memory: constant, linear, power, spline, step in time.
direct.py   Forms that replace the value.
lagging.py  Forms with memory: lag, dead time.
relay.py    A switch with two thresholds.
faults.py   Parts that stick or leak, switches, hidden stores.
catalogue.py  All forms by name.
"""
