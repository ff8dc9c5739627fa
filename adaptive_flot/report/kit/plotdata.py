"""What figures of many values are made of: plain frozen data. What charts over time are made of is in `charts`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from adaptive_flot.charts.plotdata import Role
from adaptive_flot.greybox.model import FloatArray


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
