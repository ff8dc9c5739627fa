"""When something happened.

Map
---
switching.py    When something was switched on and off.
halting.py      When a part did not follow what it was asked.
pauses.py       Events that stop for short pauses only.
turned_over.py  Events that are there from the first row on.
"""
