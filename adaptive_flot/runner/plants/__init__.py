"""Plants, and the faults between plant and controller.

Map
---
plant.py              A simulated plant, and a measured record that is replayed.
scenario_plant.py     The simulated plant of a run, from its scenario and seed.
true_outputs.py       Outputs without what effects on sensors make them show.
fault_injection.py    Puts the faults of a scenario between plant and controller.
faulty_plant.py       Instruments and actuators that fail.
faulty_controller.py  A controller that gets into trouble.
frozen_values.py      Instruments whose value repeats itself count as missing.
"""
