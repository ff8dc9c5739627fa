"""The modes of the adaptive multiple-model filter, and how the process goes from one to another.

z = (x, c, v, b): model state, parameter coordinates, their rates, and a discrepancy of each driving output. Which rates
move and how far an output may be off is a matter of the mode.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

import numpy as np

from adaptive_flot.contracts import Setup
from adaptive_flot.greybox.model import FloatArray
from estimators.shared.coordinates import Coordinates
from estimators.shared.joint_filter import HOUR, Layout

Kind = Literal["rest", "drift", "joint_drift", "jump", "walk", "reference"]
KINDS: tuple[Kind, ...] = ("rest", "drift", "joint_drift", "jump", "walk")
"""What may be asked for; the reference is no description of the process, see `estimator.py`."""
STRAIGHT = 0.2
"""Share of the changes that another one follows at once; the others go to rest."""


@dataclass(frozen=True)
class Changes:
    """How parameters move; shares are of the parameter.

    Attributes
    ----------
    rate_per_hour
        Standard deviation of the rate with which one parameter begins to drift [1/h].
    joint_rate_per_hour
        The same for all parameters that drift at once [1/h].
    rate_change_per_hour
        Standard deviation by which a rate changes within an hour [1/h].
    jump
        Standard deviation of what a jump adds within a second.
    disturbance_jump
        The same for an unmeasured disturbance.
    walk_per_hour
        Standard deviation of a random walk of all parameters after an hour.
    background_per_hour
        The same for the walk that goes on in every other mode.
    reference_per_hour
        The same for the walk of the reference; 0 for none.
    state_noise
        As for `ekf`.
    """

    rate_per_hour: float
    joint_rate_per_hour: float
    rate_change_per_hour: float
    jump: float
    disturbance_jump: float
    walk_per_hour: float
    background_per_hour: float
    reference_per_hour: float
    state_noise: float


@dataclass(frozen=True)
class Modes:
    """M modes as arrays.

    Attributes
    ----------
    kinds
        Kind of each.
    noise
        Variance that an interval adds to each entry of z but the discrepancies (M, n).
    entry
        Variance of the rates when a mode begins (M, n), zero elsewhere.
    discrepancy
        Standard deviation of the discrepancy of an output, as a multiple of its noise (M,).
    """

    kinds: tuple[Kind, ...]
    noise: FloatArray
    entry: FloatArray
    discrepancy: FloatArray

    @classmethod
    def of(
        cls,
        setup: Setup,
        coordinates: Coordinates,
        shape: Layout,
        kinds: Collection[str],
        changes: Changes,
        levels: Collection[float],
    ) -> Modes:
        """The kinds asked for with a right model; walk of them, or else rest, with each level; the reference last."""
        q, size = shape.q, shape.size + len(setup.outputs)
        own = q - len(setup.unmeasured)
        quiet, none = np.zeros(size), np.zeros(size)
        scales = np.array([state.scale for state in setup.model.states])
        quiet[: shape.nx] = (changes.state_noise * scales) ** 2 * setup.dt
        quiet[shape.coordinates] = (changes.background_per_hour * coordinates.scale) ** 2 / HOUR * setup.dt
        found: list[tuple[Kind, FloatArray, FloatArray, float]] = []

        def drifting(which: list[int], rate: float) -> tuple[FloatArray, FloatArray]:
            noise, entry, rates = quiet.copy(), none.copy(), [shape.nx + q + i for i in which]
            scale = coordinates.scale[which]
            noise[rates] = (changes.rate_change_per_hour * scale / HOUR) ** 2 * setup.dt / HOUR
            entry[rates] = (rate * scale / HOUR) ** 2
            return noise, entry

        def walking(per_hour: float) -> FloatArray:
            noise = quiet.copy()
            noise[shape.coordinates] = (per_hour * coordinates.scale) ** 2 / HOUR * setup.dt
            return noise

        walk = walking(changes.walk_per_hour)
        if "rest" in kinds:
            found.append(("rest", quiet, none, 0.0))
        if "drift" in kinds:
            found += [("drift", *drifting([i], changes.rate_per_hour), 0.0) for i in range(own)]
        if "joint_drift" in kinds and own > 1:
            found.append(("joint_drift", *drifting(list(range(own)), changes.joint_rate_per_hour), 0.0))
        for i in range(q if "jump" in kinds else 0):
            noise = quiet.copy()
            size_of = changes.jump if i < own else changes.disturbance_jump
            noise[shape.nx + i] += (size_of * coordinates.scale[i]) ** 2 * setup.dt
            found.append(("jump", noise, none, 0.0))
        if "walk" in kinds:
            found.append(("walk", walk, none, 0.0))
        for level in levels:
            found.append(("walk", walk, none, level) if "walk" in kinds else ("rest", quiet, none, level))
        if changes.reference_per_hour > 0:
            found.append(("reference", walking(changes.reference_per_hour), none, 0.0))
        names, noises, entries, sizes = zip(*found, strict=True)
        return cls(names, np.array(noises), np.array(entries), np.array(sizes))


def transitions(
    modes: Modes, durations: dict[Kind, float], shares: dict[Kind, float], error: tuple[float, float], dt: float
) -> FloatArray:
    """Probability of going from mode i to mode j within one interval (M, M).

    Parameters
    ----------
    modes
        The modes.
    durations
        Mean duration of each kind [s]; they are geometric, and no shorter than an interval.
    shares
        Share of each kind among the changes; several modes of a kind share it.
    error
        Mean time until the model becomes wrong, and for which it stays so or changes its size [s].
    dt
        Sampling interval [s].
    """
    levels, kinds = modes.discrepancy, np.array(modes.kinds)
    matrix = np.zeros((len(kinds), len(kinds)))
    for i, kind in enumerate(modes.kinds):
        if kind == "reference":
            matrix[i, i] = 1.0
            continue
        beside = levels == levels[i]
        change = np.array([shares.get(k, 0.0) / max(int(np.sum(beside & (kinds == k))), 1) for k in modes.kinds])
        change *= beside & (np.arange(len(kinds)) != i) & (kinds != "rest")
        change /= max(change.sum(), 1e-300)
        rest = (beside & (kinds == "rest")).astype(float)
        to = change if kind == "rest" or not rest.any() else (1 - STRAIGHT) * rest + STRAIGHT * change
        leave = min(1.0, dt / durations[kind]) if to.sum() > 0 else 0.0
        matrix[i] = leave * to
        matrix[i, i] += 1 - leave
        other = (~beside & np.isin(kinds, ("rest", "walk"))).astype(float)
        if other.any():
            wrong = min(1.0, dt / error[0 if levels[i] == 0 else 1])
            matrix[i] = (1 - wrong) * matrix[i] + wrong * other / other.sum()
    scaled: FloatArray = matrix / matrix.sum(axis=1, keepdims=True)
    return scaled
