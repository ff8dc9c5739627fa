"""What a flotation cell is described by: every parameter with its unit and physical range."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from adaptive_flot.greybox.model import Parameter


@dataclass(frozen=True)
class Spec:
    """What a cell file must hold under one key: name, unit, range, symbol, whether it varies or drifts by itself."""

    name: str
    unit: str
    lower: float
    upper: float = np.inf
    symbol: str | None = None
    group: Literal["mineral", "bubble"] | None = None
    disturbance: bool = False
    drifts: bool = False


_TINY = 1e-12
PARAMETERS: dict[str, dict[str, Spec]] = {
    "cell": {
        "cross_section_area": Spec("cross_section_area", "m2", _TINY, symbol="A"),
        "volume": Spec("volume", "m3", _TINY),
        "height": Spec("height", "m", _TINY, symbol="h_T"),
    },
    "pulp": {
        "solids_fraction": Spec("solids_fraction", "-", 0.0, 0.9, symbol="phi"),
        "solids_density": Spec("solids_density", "kg/m3", 1000.0, 2e4),
        "water_density": Spec("water_density", "kg/m3", 500.0, 2000.0),
        "water_viscosity": Spec("water_viscosity", "Pa s", 1e-5, 1.0),
        "gravity": Spec("gravity", "m/s2", _TINY, 100.0, symbol="g"),
    },
    "bubbles": {
        "diameter": Spec("bubble_diameter", "m", 1e-6, 0.1, group="bubble"),
        "number": Spec("bubble_number", "-", 0.0, group="bubble"),
    },
    "froth": {
        "growth_exponent": Spec("growth_exponent", "-", 0.3, 5.0, symbol="n", drifts=True),
        "coalescence_rate": Spec("coalescence_rate", "m^n/s", 1e-6, 0.1, symbol="C", drifts=True),
        "burst_a": Spec("burst_a", "m/s", -0.1, 0.1, symbol="a"),
        "burst_b": Spec("burst_b", "-", 0.0, 1.0, symbol="b"),
        "burst_c": Spec("burst_c", "s/m", -100.0, 100.0, symbol="c"),
        "drag_coefficient": Spec("drag_coefficient", "-", 1.0, 1000.0, symbol="C_PB"),
        "plateau_border": Spec("plateau_border", "-", 0.1, 100.0),
        "peclet": Spec("peclet", "-", 1e-3, 100.0, symbol="Pe"),
    },
    "minerals": {
        "floatability": Spec("floatability", "-", 0.0, 0.1, group="mineral"),
        "particle_diameter": Spec("particle_diameter", "m", 1e-7, 1e-2, group="mineral"),
        "density": Spec("mineral_density", "kg/m3", 1001.0, 2.5e4, group="mineral"),
        "feed_concentration": Spec("feed_concentration", "kg/m3", 0.0, 2e4, group="mineral", disturbance=True),
    },
    "level_loop": {
        "proportional_gain": Spec("proportional_gain", "m2/s", _TINY, 10.0, symbol="k_p"),
        "integral_time": Spec("integral_time", "s", 0.1, 1e6, symbol="tau_i"),
    },
}
OPERATION_UNITS = {
    "feed_flow": "m3/s",
    "air_flow_limits": "m3/s",
    "air_flow_valid": "m3/s",
    "level_limits": "m",
    "grade_noise": "-",
}


@dataclass(frozen=True)
class Cell:
    """A flotation cell: model parameters, mineral names and operating values, all in SI units.

    `operation` holds `feed_flow` (1,), `air_flow_limits` and `level_limits` (2,: where the cell is run),
    `air_flow_valid` (2,: where the model means anything), `grade_noise` (1,: standard deviation).
    """

    name: str
    parameters: tuple[Parameter, ...]
    minerals: tuple[str, ...]
    bubble_classes: int
    operation: Mapping[str, tuple[float, ...]]

    def value(self, name: str) -> float:
        """Value of a parameter by name or symbol."""
        return next(p.value for p in self.parameters if name in (p.name, p.symbol))
