"""Controllers: plug-ins that the core knows by address only.

Map
---
schedule.py      Plays a table of inputs: open loop.
hold.py          Holds the first inputs.
pi.py            Proportional-integral control of one output by one input.
feed_forward.py  What a measured disturbance asks of that input, before the output shows it.
economic_mpc/    Economic model predictive control.
"""
