"""Fit the nominal cell (n and C free, nothing else) to a record: what an honest user without the effect would have.

Gauss-Newton on the outputs, each over its noise; the first `BURN_IN` seconds carry the unknown initial state and do not
count. Used to size effects (what n and C can soak up is no effect) and to report the base error.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from benchmarks.hidden_effects.cell.equations import World
from benchmarks.hidden_effects.cell.simulate import Array, SimulationError, replay
from benchmarks.hidden_effects.cell.sites import OUTPUTS

BURN_IN = 300  # s; five time constants of the gas, one of the minerals
REACH = np.array([0.3, 1.2])  # how far ln n and ln C may be moved: beyond it the froth is another one
_STEP = np.array([2e-3, 2e-3])  # of ln n and ln C, for the differences


@dataclass(frozen=True)
class NominalFit:
    """Nominal cell at the fitted n and C, and what it predicts at every row."""

    n: float
    C: float
    predicted: dict[str, Array]


def _run(theta: Array, inputs: Array, start: list[float]) -> dict[str, Array]:
    return replay(World(n=float(np.exp(theta[0])), C=float(np.exp(theta[1]))), inputs, start)


def _stack(columns: Mapping[str, Array], noise: Mapping[str, float], rows: slice) -> Array:
    return np.concatenate([columns[name][rows] / noise[name] for name in noise])


def sensitivity(
    theta: Array, inputs: Array, start: list[float], base: Mapping[str, Array], names: tuple[str, ...] = OUTPUTS
) -> list[dict[str, Array]]:
    """Derivatives of the outputs with respect to ln n and ln C by forward differences: a table each."""
    tables = []
    for j in range(2):
        moved = _run(theta + _STEP * np.eye(2)[j], inputs, start)
        tables.append({name: (moved[name] - base[name]) / _STEP[j] for name in names})
    return tables


def project(
    difference: Mapping[str, Array], slopes: list[dict[str, Array]], noise: Mapping[str, float], rows: slice
) -> dict[str, Array]:
    """Part of a difference (a table) that changes of ln n and ln C do not explain, to first order.

    The two nearly cancel along a ridge, so the changes are bounded by `REACH`.
    """
    J = np.column_stack([_stack(slope, noise, rows) for slope in slopes])
    shift = lsq_linear(J, _stack(difference, noise, rows), bounds=(-REACH, REACH)).x
    return {
        name: difference[name] - sum(float(s) * slope[name] for s, slope in zip(shift, slopes, strict=True))
        for name in noise
    }


def fit_nominal(
    inputs: Array, measured: Mapping[str, Array], noise: Mapping[str, float], start: list[float], rows: slice,
    guess: tuple[float, float], iterations: int = 5,
) -> NominalFit:  # fmt: skip
    """Fit ln n and ln C on `rows` of the measured outputs (N,), each over its noise; missing values are left out.

    start: state of the nominal cell before the first row. Steps are halved while they do not reduce the sum of squares.
    """
    theta = first = np.log(np.array(guess))
    predicted = _run(theta, inputs, start)
    y = _stack(measured, noise, rows)
    used = np.isfinite(y)

    def cost(columns: Mapping[str, Array]) -> float:
        return float(np.mean((y - _stack(columns, noise, rows))[used] ** 2))

    for _ in range(iterations):
        slopes = sensitivity(theta, inputs, start, predicted, tuple(noise))
        J = np.column_stack([_stack(slope, noise, rows) for slope in slopes])[used]
        low, high = np.maximum(first - REACH - theta, -0.5), np.minimum(first + REACH - theta, 0.5)
        step = lsq_linear(J, (y - _stack(predicted, noise, rows))[used], bounds=(low - 1e-9, high + 1e-9)).x
        before, accepted = cost(predicted), False
        for _ in range(4):
            try:
                trial = _run(theta + step, inputs, start)
            except SimulationError:
                step = 0.5 * step
                continue
            if cost(trial) < before:
                theta, predicted, accepted = theta + step, trial, True
                break
            step = 0.5 * step
        if not accepted or before - cost(predicted) < 0.01 * before:
            break
    return NominalFit(float(np.exp(theta[0])), float(np.exp(theta[1])), predicted)
