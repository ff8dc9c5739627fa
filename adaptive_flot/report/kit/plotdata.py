"""What the figures are made of: plain frozen data, made by `series` and drawn by `figures`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from adaptive_flot.greybox.model import FloatArray


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
        Place among the lines of its role: gives the colour.
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


@dataclass(frozen=True)
class Residuals:
    """Innovations of one estimator for one output, divided by the standard deviation it expects: (N,) at times [s]."""

    label: str
    role: Role
    index: int
    time: FloatArray
    values: FloatArray
    p_value: float


@dataclass(frozen=True)
class Spread:
    """Values of one quantity over the seeds, by who has them, and published ones; `label` is that of the axis."""

    label: str
    values: Mapping[str, FloatArray]
    published: Mapping[str, float] = field(default_factory=dict)
