"""Hypotheses of what happens at given times: their effects, with the coefficients that a fit then finds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.discovery.hypotheses.families import FOREVER, MATTERS, Hypothesis
from adaptive_flot.discovery.innovations.courses import Suspect
from adaptive_flot.discovery.innovations.events.cycling import Cycle
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect, Mode
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.scope import Site

EDGE = 0.05
"""Width of the edges of a switch, in sampling intervals."""


def ramp_between(site: Site, by: FloatArray, record: Dataset, begin: int, end: int) -> Suspect:
    """A change that grows from one interval to another and stays, of a course (N - 1,)."""
    count = len(by)
    share = np.clip((np.arange(count) + 0.5 - begin) / (end - begin), 0.0, 1.0)
    times = {"onset": float(record.time[begin]), "duration": float((end - begin) * record.dt)}
    effect = Effect(site.name, "time", "ramp", {"amplitude": 0.0, **times}, {}, mode=site.mode)
    hypothesis = Hypothesis(site.name, "time", "ramp", effect, ("amplitude",), ({},))
    return Suspect(hypothesis, (by * share)[:, None], ("amplitude",), 2)


def late_after(site: Site, dt: float) -> float:
    """How long after a row a switch is [s]: a sensor's is between two, what acts on a state begins with an interval."""
    return dt / 2 if site.role == "sensor" else 0.0


def pulse_of(site: Site, record: Dataset, begin: int, end: int) -> tuple[float, float]:
    """When an event of some intervals begins [s], and how long it is there [s]: FOREVER where it lasts to the end."""
    time = record.time
    lasts = end >= len(time) - 1
    return float(time[begin] + late_after(site, record.dt)), FOREVER if lasts else float(time[end] - time[begin])


def times_of_switch(pulses: Sequence[tuple[float, float]]) -> dict[str, float]:
    """Coefficients of a switch of no size yet, from its times and durations [s]."""
    told = {"amplitude": 0.0}
    for k, (on, length) in enumerate(pulses, 1):
        told |= {f"on_{k}": on, f"for_{k}": length}
    return told


def switch_at(site: Site, mode: Mode, pulses: Sequence[tuple[float, float]], dt: float) -> Hypothesis:
    """A switch whose size is free, from its times and durations [s]."""
    settings = {"count": float(len(pulses)), "width": EDGE * dt}
    effect = Effect(site.name, "time", "switch", times_of_switch(pulses), settings, mode=mode)
    return Hypothesis(site.name, "time", "switch", effect, ("amplitude",), ({},))


def cycle_at(site: Site, cycle: Cycle, dt: float) -> Hypothesis:
    """A switch of every period whose size is free."""
    told = {"amplitude": 0.0, "onset": cycle.onset, "duration": cycle.duration, "period": cycle.period}
    effect = Effect(site.name, "time", "cycle", told, {"width": EDGE * dt}, mode=site.mode)
    return Hypothesis(site.name, "time", "cycle", effect, ("amplitude",), ({},))


def halt_at(site: Site, seen: FloatArray, level: float, pulse: tuple[float, float], dt: float) -> Hypothesis:
    """A part that stays at a level, which is free, for a time [s]; an actuator within the range seen of it (n,)."""
    told = {"amplitude": 1.0, "level": level, "on_1": pulse[0], "for_1": pulse[1]}
    effect = Effect(site.name, "time", "stuck_while", told, {"width": EDGE * dt})
    low, high = float(seen.min()), float(seen.max())
    limits, scales = {"level": (low, high)} if site.role == "actuator" else {}, {"level": MATTERS * (high - low)}
    return Hypothesis(site.name, "time", "stuck for a time", effect, ("level",), ({},), limits, scales)
