"""Controllers: plug-ins that the core knows by address only.

Map
---
schedule.py    Plays a table of inputs: open loop.
hold.py        Holds the first inputs.
pi.py          Proportional-integral control of grade and level.
economic_mpc/  Economic model predictive control.
"""
