"""Processes that cases are made of: shipped ones, and how to describe one's own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from adaptive_flot.contracts import Economics, Limits
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.processes import cascaded_tanks, flotation
from adaptive_flot.processes.flotation.economics import Prices

ROWS = 40
"""Samples of a case."""


@dataclass(frozen=True)
class CaseProcess:
    """A process, and what of it is recorded, estimated and controlled in a case.

    Attributes
    ----------
    model
        The model; its parameter values are the nominal ones.
    dt
        Sampling interval [s].
    inputs
        Inputs of the record (ROWS, nu); at the first row there is a steady state, from which it starts.
    parameters
        Names of the parameters to adapt.
    outputs
        Names of the outputs that drive the adaptation.
    drifting
        Name of the parameter that grows by 2 % over the record.
    limits, economics
        For controllers.
    """

    model: Model
    dt: float
    inputs: FloatArray
    parameters: Sequence[str]
    outputs: Sequence[str]
    drifting: str
    limits: Limits | None = None
    economics: Economics | None = None


@cache
def flotation_process() -> CaseProcess:
    """Laboratory flotation cell: air and level set-point step, the growth exponent n drifts."""
    inputs = np.tile([1.5e-3, 1.67e-4, 0.38], (ROWS, 1))
    inputs[ROWS // 2 :, 0], inputs[ROWS // 4 :, 2] = 1.7e-3, 0.36
    limits = Limits(
        outputs={"concentrate_grade": (0.20, np.inf)},
        inputs={"air_flow": (9.05e-4, 2.17e-3), "level_setpoint": (0.33, 0.42)},
        moves={"air_flow": 2e-4, "level_setpoint": 0.01},
        states={"level": (0.33, 0.42)},
    )
    # one model for all checks: what is compiled for it is compiled once
    return CaseProcess(
        flotation.make_model(),
        1.0,
        inputs,
        ("growth_exponent", "coalescence_rate"),
        ("concentrate_grade",),
        "growth_exponent",
        limits,
        Prices(),
    )


@cache
def tanks_process() -> CaseProcess:
    """Cascaded tanks: the pump steps, the hole of the lower tank widens."""
    inputs = np.full((ROWS, 1), 1.5)
    inputs[ROWS // 4 :], inputs[ROWS // 2 :] = 2.0, 1.2
    limits = Limits(
        outputs={"level": (0.5, 5.0)},
        inputs={"pump_voltage": (0.0, 5.0)},
        moves={"pump_voltage": 0.5},
        states={"upper_level": (0.0, 10.0)},
    )
    return CaseProcess(
        cascaded_tanks.make_model(),
        2.0,
        inputs,
        ("upper_outflow", "lower_outflow"),
        ("level",),
        "lower_outflow",
        limits,
        cascaded_tanks.PumpingEconomics(),
    )
