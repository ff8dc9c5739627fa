"""The processes, a file each: the user's model, and the plant that is richer than it."""

from benchmarks.other_processes.plants import (
    building,
    dc_motor,
    dosing,
    fan_filter,
    heat_exchanger,
    heated_box,
    level_tank,
    mixing_tank,
    room_air,
    two_tanks,
)
from benchmarks.other_processes.process import Process

PROCESSES: tuple[Process, ...] = tuple(
    module.PROCESS
    for module in (
        heated_box,
        building,
        dc_motor,
        level_tank,
        heat_exchanger,
        mixing_tank,
        two_tanks,
        room_air,
        fan_filter,
        dosing,
    )
)
"""In the order in which records take their turn."""
