"""When something happened, by the response of the innovations.

Map
---
switching.py  When something was switched on and off.
halting.py    When a part did not follow what it was asked.
cycling.py    When something was switched on in every period.
at_times.py   Hypotheses of what happens at given times.
"""
