"""Four processes with what their models have no site for, beside faults at a site.

Gas that is lost, another volume, a seat that no longer closes, heat that nobody counts, an input that is read wrongly.
A name at a site is wrong there. `abstain` is right, and so is a class that has the place as a member.
"""

from benchmarks.other_processes.process import Process
from benchmarks.other_processes.without_a_site import basin, block, valve, vessel

WITHOUT_A_SITE: tuple[Process, ...] = tuple(module.PROCESS for module in (vessel, block, valve, basin))
"""In the order in which records take their turn."""
