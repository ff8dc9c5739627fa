"""Four more processes, which no rule of the search was ever made on before they were first judged.

An oscillator, an integrator whose output jumps with its input, a tube with a dead time, and a reaction that is not
linear. They tell whether what was learned on the ten others holds elsewhere.
"""

from benchmarks.other_processes.further import battery, dryer, reactor, spring
from benchmarks.other_processes.process import Process

FURTHER: tuple[Process, ...] = tuple(module.PROCESS for module in (battery, spring, dryer, reactor))
"""In the order in which records take their turn."""
