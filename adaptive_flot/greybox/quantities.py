"""Named physical quantities and parameters: what a model is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from adaptive_flot.errors import ModelError, RangeError

FloatArray = NDArray[np.float64]
ParameterRole = Literal["fixed", "estimated"]
Kind = Literal["states", "inputs", "parameters", "outputs", "signals", "algebraic"]
DIMENSIONLESS = ("-", "", "1")
ROUNDING = 1e-9
"""Share of the end of a range by which a value may lie beyond it and is still at it."""
ARBITRARY_ZERO = ("K", "degC", "degF")
"""Units of temperature: the same record in any of them says the same."""


@dataclass(frozen=True)
class Quantity:
    """A named physical quantity: state, input, output, signal or algebraic variable.

    Attributes
    ----------
    name
        Name in tables, files and messages.
    unit
        Its unit, "-" for none.
    description
        What it is, in words.
    lower, upper
        Physical range, in the unit.
    scale
        Typical size of a change, in the unit, above zero. It conditions solvers, and says how far off the initial state
        may be. 1 is wrong for most units: give it to every state.
    usual
        Lowest and highest value of ordinary operation, in the unit: tells a wrong unit where the physical range can
        not. None where nobody knows.
    movable
        Whether a test may move it, as an input: False for one that is only measured, as the weather.
    """

    name: str
    unit: str
    description: str
    lower: float = -np.inf
    upper: float = np.inf
    scale: float = 1.0
    usual: tuple[float, float] | None = None
    movable: bool = True

    @property
    def zero_is_arbitrary(self) -> bool:
        """Whether zero is no less of it than any other value, so that shares of a value mean nothing: a temperature."""
        return self.unit in ARBITRARY_ZERO

    @property
    def column(self) -> str:
        """Name of the table column: the name, then the unit as a suffix; without one where it has no dimension.

        >>> Quantity("air_flow", "m3/s", "air").column
        'air_flow_m3_s'
        """
        return (
            self.name if self.unit in DIMENSIONLESS else f"{self.name}_{self.unit.replace('/', '_').replace(' ', '_')}"
        )


@dataclass(frozen=True)
class Parameter:
    """A model parameter.

    Attributes
    ----------
    name
        Full name; a group shares what stands before the dot (`floatability.chalcopyrite`).
    value, unit
        Value in its unit, "-" for none.
    source
        Where the value comes from.
    symbol
        Letter of the literature, accepted wherever the name is.
    lower, upper
        Physical range, in the unit.
    scale
        Size of a change that matters, in the unit: the relative scale of fits.
    prior_std
        Standard deviation of the prior in a calibration, in the unit; None for no prior.
    role
        "estimated" where a calibration fits it unless told otherwise, else "fixed".
    disturbance
        Whether it varies by itself and may be measured, as a feed grade does.
    drifts
        Whether it changes slowly in normal operation, as froth parameters do with the ore. Then a drift of it is no
        fault, and no missing effect.
    """

    name: str
    value: float
    unit: str
    source: str
    symbol: str | None = None
    lower: float = -np.inf
    upper: float = np.inf
    scale: float = 1.0
    prior_std: float | None = None
    role: ParameterRole = "fixed"
    disturbance: bool = False
    drifts: bool = False

    def end_at(self, value: float, share: float = 0.0) -> Literal["lower", "upper", ""]:
        """Which end of its range a value is at or beyond, or within a share of its size of; empty where at none.

        >>> k = Parameter("k", 2.0, "1/s", "guess", lower=1.0, upper=4.0)
        >>> k.end_at(1.0), k.end_at(3.999), k.end_at(3.999, share=1e-3)
        ('lower', '', 'upper')
        """
        near = share * abs(value)
        return "lower" if value <= self.lower + near else "upper" if value >= self.upper - near else ""

    def with_value(self, value: float) -> Parameter:
        """The same parameter with another value, in its unit; one a rounding error beyond its range is at the end.

        A fit at a bound comes back from its scaled unknowns with the last digit off.

        Raises
        ------
        RangeError
            A value outside the physical range.
        """
        inside = min(max(value, self.lower), self.upper)
        if not (np.isfinite(value) and abs(value - inside) <= ROUNDING * abs(inside)):
            raise RangeError(
                f"parameter {self.name!r} = {value:g} {self.unit} is outside its physical range "
                f"[{self.lower:g}, {self.upper:g}] {self.unit}; give a value inside it"
            )
        return replace(self, value=float(inside))

    @property
    def varies_by_factor(self) -> bool:
        """Whether what is unknown of it is a factor: a positive parameter with a dimension, such as a rate constant."""
        return self.unit not in DIMENSIONLESS and self.lower > 0

    @property
    def label(self) -> str:
        """Symbol where there is one, else the name: what tables and plots print."""
        return self.symbol or self.name


@dataclass(frozen=True)
class KnownEffect:
    """A physical effect that a model may lack, known by name.

    Attributes
    ----------
    site
        Name of the site where it acts.
    driver
        What drives it: a quantity of the model, or one of the words that `Effect` lists.
    meaning
        What it is in words, as a verdict says it.
    direction
        How the value at the site must change as the driver grows; "" where both ways are physical.
    """

    site: str
    driver: str
    meaning: str
    direction: Literal["", "rises", "falls"] = ""


def check_range(quantities: Sequence[Quantity], table: FloatArray, time: FloatArray | None, where: str) -> None:
    """Check a table (N, n) of n inputs, each in its unit, against the physical range of each.

    Raises
    ------
    ModelError
        Wrong number of columns.
    RangeError
        Names the first input that leaves its range, the row or time [s], the value and the range.
    """
    if table.shape[1] != len(quantities):
        raise ModelError(f"{where}: {table.shape[1]} columns, but the model has {len(quantities)} inputs")
    for values, q in zip(table.T, quantities, strict=True):
        outside = np.flatnonzero(~((values >= q.lower) & (values <= q.upper)))
        if outside.size:
            k = int(outside[0])
            at = f"row {k}" if time is None else f"time {time[k]:g} s"
            raise RangeError(
                f"{where}: {q.name} = {values[k]:g} {q.unit} at {at} is outside the model's range "
                f"[{q.lower:g}, {q.upper:g}] {q.unit}; correct the value, its unit, or the range in the model"
            )
