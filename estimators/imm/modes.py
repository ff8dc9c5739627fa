"""The modes of the multiple-model filter and how the process goes from one to another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from adaptive_flot.contracts import Setup
from adaptive_flot.greybox.model import FloatArray
from estimators.shared.coordinates import Coordinates
from estimators.shared.joint_filter import HOUR, Layout, process_noise

Kind = Literal["rest", "drift", "jump"]


@dataclass(frozen=True)
class Mode:
    """One kind of change.

    Attributes
    ----------
    kind
        What it is.
    parameter
        Position of the parameter that changes; None at rest.
    noise
        Process noise of an interval (n, n).
    entry
        Covariance of the rates when the mode begins (n, n), zero elsewhere.
    """

    kind: Kind
    parameter: int | None
    noise: FloatArray
    entry: FloatArray


def make_modes(
    setup: Setup,
    coordinates: Coordinates,
    shape: Layout,
    rate_per_hour: float,
    rate_change_per_hour: float,
    jump: float,
    state_noise: float,
) -> tuple[Mode, ...]:
    """Rest; each parameter drifts; each parameter jumps: 2 q + 1 modes."""
    q, scale = shape.q, coordinates.scale
    quiet = process_noise(setup, coordinates, shape, np.zeros(q), state_noise)
    modes = [Mode("rest", None, quiet, np.zeros_like(quiet))]
    for i in range(q):
        rate = shape.nx + q + i
        noise, entry = quiet.copy(), np.zeros_like(quiet)
        # share an hour and hour -> coordinate a second; the rate does a random walk
        noise[rate, rate] = (rate_change_per_hour * scale[i] / HOUR) ** 2 * setup.dt / HOUR
        entry[rate, rate] = (rate_per_hour * scale[i] / HOUR) ** 2
        modes.append(Mode("drift", i, noise, entry))
    for i in range(q):
        noise = quiet.copy()
        noise[shape.nx + i, shape.nx + i] = (jump * scale[i]) ** 2 * setup.dt
        modes.append(Mode("jump", i, noise, np.zeros_like(quiet)))
    return tuple(modes)


def transitions(modes: Sequence[Mode], durations: Mapping[Kind, float], jump_share: float, dt: float) -> FloatArray:
    """Probability of going from mode i to mode j within one interval (M, M).

    Durations are geometric with the means given [s], and no shorter than an interval. What ends goes to rest, or (one
    time in five) straight to the change of a parameter; a change is a jump with probability `jump_share`.
    """
    changes = np.array([0.0 if m.kind == "rest" else jump_share if m.kind == "jump" else 1 - jump_share for m in modes])
    rest = np.array([float(m.kind == "rest") for m in modes])
    matrix = np.zeros((len(modes), len(modes)))
    for i, mode in enumerate(modes):
        others = changes.copy()
        others[i] = 0.0
        others /= max(others.sum(), 1e-300)
        leave = min(1.0, dt / durations[mode.kind])
        to = others if mode.kind == "rest" else 0.8 * rest + 0.2 * others
        matrix[i] = leave * to
        matrix[i, i] += 1 - leave
    scaled: FloatArray = matrix / matrix.sum(axis=1, keepdims=True)
    return scaled


def stationary(matrix: FloatArray) -> FloatArray:
    """Share of time that a chain with this transition matrix (M, M) spends in each mode (M,)."""
    size = len(matrix)
    rows = np.vstack([matrix.T - np.eye(size), np.ones(size)])
    shares: FloatArray = np.maximum(np.linalg.lstsq(rows, np.append(np.zeros(size), 1.0), rcond=None)[0], 0.0)
    return shares / float(shares.sum())
