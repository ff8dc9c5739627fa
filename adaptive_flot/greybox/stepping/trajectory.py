"""A simulated record, and its derivatives."""

from __future__ import annotations

from dataclasses import dataclass

from adaptive_flot.greybox.model import FloatArray


@dataclass(frozen=True)
class Trajectory:
    """A simulated record of N rows, each at the end of an interval.

    Attributes
    ----------
    time
        Time of each row [s] (N,).
    states, outputs, signals
        Their values (N, nx), (N, ny) and (N, ns), in the model's units.
    """

    time: FloatArray
    states: FloatArray
    outputs: FloatArray
    signals: FloatArray


@dataclass(frozen=True)
class Sensitivities:
    """A simulated record of N rows and its derivatives for q unknowns.

    Attributes
    ----------
    outputs, gradient
        Outputs (N, ny) and their derivatives (N, ny, q).
    last_state, last_state_gradient
        State at the end (nx,) and its derivatives (nx, q).
    """

    outputs: FloatArray
    gradient: FloatArray
    last_state: FloatArray
    last_state_gradient: FloatArray
