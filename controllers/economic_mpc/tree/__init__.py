"""Plans whose first move keeps the limits in every scenario.

Map
---
tree_planner.py    From an estimate and scenarios to a plan.
scenario_tree.py   The tree of scenarios as one NLP.
tree_layout.py     Where each stage of a tree stands in its vectors.
tree_step.py       The iteration of a tree.
tree_programme.py  Its quadratic programme.
"""
