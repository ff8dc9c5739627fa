"""What controllers are worth, in closed loop.

Map
---
closed_loop.py         Every scenario with every controller.
value_of_knowledge.py  What knowing the parameters is worth.
probing.py             What probing costs.
freezing.py            What freezing a starved estimator is worth.
modifiers.py           What modifiers win where slopes are wrong.
"""
