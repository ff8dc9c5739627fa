"""What charts over time are made of: plain frozen data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from adaptive_flot.greybox.quantities import FloatArray


class Role(Enum):
    """What a line stands for; it decides how the line looks."""

    TRUTH = "truth"
    CONSTANT = "constant"
    ESTIMATE = "estimate"
    KNOWING = "knowing"  # what perfect knowledge would do
    FOLLOWED = "followed"
    PLAN = "plan"


@dataclass(frozen=True)
class Trace:
    """One line.

    Attributes
    ----------
    label
        Entry in the legend; none if empty.
    time
        Time [s] (N,).
    values
        Values (N,) in the panel's unit, NaN where there is none.
    role
        What the line stands for.
    index
        Place in the palette: gives the colour, see `palette.contender_slots`.
    std
        Standard deviation (N,) for a band of two, or None.
    held
        Whether the value was held since the time before (drawn as steps).
    """

    label: str
    time: FloatArray
    values: FloatArray
    role: Role
    index: int = 0
    std: FloatArray | None = None
    held: bool = False


@dataclass(frozen=True)
class Panel:
    """One set of axes over time.

    Attributes
    ----------
    label
        Quantity on the vertical axis.
    unit
        Its unit as models write it (`m3/s`, `-`).
    traces
        The lines.
    height
        Height relative to the other panels.
    zoom
        Let the vertical axis follow the lines of role ESTIMATE only; what leaves the panel is cut off.
    band
        Half width of a shaded band around zero in the panel's unit, or None; its legend entry is `band_label`.
    limits
        Values that must not be crossed, drawn as lines.
    """

    label: str
    unit: str
    traces: tuple[Trace, ...]
    height: float = 1.0
    zoom: bool = False
    band: float | None = None
    band_label: str = ""
    limits: tuple[float, ...] = ()

    def followed(self) -> list[Trace]:
        """Lines that the vertical axis follows where `zoom` is set."""
        return [t for t in self.traces if t.role is Role.ESTIMATE] if self.zoom else []

    def zoom_limits(self) -> tuple[float, float] | None:
        """Ends of the vertical axis in the panel's unit where `zoom` is set, with some room."""
        lines = self.followed()
        if not lines:
            return None
        half = 1.5 * (self.band or 0.0)
        low = min(float(np.nanmin(t.values, initial=-half)) for t in lines)
        high = max(float(np.nanmax(t.values, initial=half)) for t in lines)
        room = 0.08 * (high - low) or 1.0
        return low - room, high + room


@dataclass(frozen=True)
class Strip:
    """One row of states: label, time [s] (N,) at the end of each interval, and the state in each of them (N,).

    `usual` is the state that needs no attention; it is drawn grey.
    """

    label: str
    time: FloatArray
    states: Sequence[str]
    usual: str

    def spells(self) -> list[tuple[str, float, float]]:
        """(state, start, stop) of each spell in which a state lasts; intervals end at their time."""
        states = np.asarray(self.states)
        first = np.flatnonzero(np.r_[True, states[1:] != states[:-1]])
        dt = float(self.time[1] - self.time[0]) if len(self.time) > 1 else 1.0
        starts = np.r_[self.time[0] - dt, self.time[:-1]][first]
        return list(
            zip(states[first].tolist(), starts.tolist(), [*starts[1:].tolist(), float(self.time[-1])], strict=True)
        )


@dataclass(frozen=True)
class Mark:
    """A moment to mark in every panel: time [s], and what it is."""

    time: float
    label: str


@dataclass(frozen=True)
class Chart:
    """Panels from top to bottom over one axis.

    Attributes
    ----------
    panels
        Lines.
    strips
        Rows of states below them.
    marks
        Moments to mark.
    x_label, x_unit
        Of the common axis, as models write units.
    """

    panels: tuple[Panel, ...] = ()
    strips: tuple[Strip, ...] = ()
    marks: tuple[Mark, ...] = ()
    x_label: str = "time"
    x_unit: str = "s"

    @property
    def over_time(self) -> bool:
        """Whether the common axis is time."""
        return (self.x_label, self.x_unit) == ("time", "s")

    def limits(self) -> tuple[float, float]:
        """Ends of the common axis: from the start of the first interval (values belong to its end) to the last one."""
        times = [t.time for p in self.panels for t in p.traces if t.role is not Role.PLAN and len(t.time)]
        times += [s.time for s in self.strips]
        if not times:
            return 0.0, 1.0
        first = min(times, key=lambda time: float(time[0]))
        step = (float(first[1] - first[0]) if len(first) > 1 else 1.0) if self.over_time else 0.0
        return float(first[0]) - step, max(float(time[-1]) for time in times)
