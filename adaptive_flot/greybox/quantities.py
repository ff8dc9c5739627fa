"""Named physical quantities and parameters: what a model is made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Kind = Literal["states", "inputs", "parameters", "outputs", "signals", "algebraic"]


@dataclass(frozen=True)
class Quantity:
    """A named physical quantity: state, input, output, signal or algebraic variable.

    `lower` and `upper` are the physical range in the unit given; `scale` is a typical size, used to condition
    solvers and as the standard deviation of an unknown initial state.
    """

    name: str
    unit: str
    description: str
    lower: float = -np.inf
    upper: float = np.inf
    scale: float = 1.0

    @property
    def column(self) -> str:
        """Name of the table column: the name, then the unit as a suffix.

        >>> Quantity("air_flow", "m3/s", "air").column
        'air_flow_m3_s'
        """
        return self.name if self.unit == "-" else f"{self.name}_{self.unit.replace('/', '_').replace(' ', '_')}"


@dataclass(frozen=True)
class Parameter:
    """A model parameter with its value, unit, source, physical range and role in a calibration.

    `symbol` is the letter of the literature, accepted wherever the name is. `scale` is the size of a change that
    matters (relative scale of fits); `prior_std` the standard deviation of the prior in a calibration, None for none.
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
    role: Literal["fixed", "estimated"] = "fixed"

    @property
    def label(self) -> str:
        """Symbol where there is one, else the name: what tables and plots print."""
        return self.symbol or self.name


@dataclass(frozen=True)
class KnownEffect:
    """A physical effect that a model may lack: where it acts, what drives it, and what it is in words.

    Attributes
    ----------
    direction
        How the value at the site must change as the driver grows; "" where both ways are physical.
    """

    site: str
    driver: str
    meaning: str
    direction: Literal["", "rises", "falls"] = ""
