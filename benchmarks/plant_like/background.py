"""What is wrong on every plant-like record, besides an effect: constants, a wandering feed, noise with memory, gaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from benchmarks.hidden_effects.cell.simulate import Array
from benchmarks.hidden_effects.cell.sites import OUTPUTS
from benchmarks.hidden_effects.effects.curves import Parameters
from benchmarks.hidden_effects.effects.spec import Spec
from benchmarks.hidden_effects.plant.noise import TYPICAL, MeasurementNoise

Rng = np.random.Generator

ROWS, EVERY = 28_800, 10
"""Seconds of a record, and of its sampling interval."""
BURN = 1_200
"""Seconds before the record starts."""
WRONG = ("bubble_size", "gas_slip", "froth_recovery", "entrainment", "settling", "floatability_valuable",
         "floatability_gangue", "film_drainage")  # fmt: skip
"""Sites whose constants may be off."""
OFF = 0.1
"""Standard deviation of such a constant, in its logarithm."""
CONSTANTS = (3, 6)
"""How many are off."""
WANDER = (0.02, 0.05)
"""Standard deviation of the feed grade, as a share of it."""
WANDERS_OVER = (900.0, 3600.0)
"""Seconds over which it wanders."""
MEMORY = (0.5, 0.9)
"""Memory of the noise from one row to the next."""
OUTLIERS = (0.001, 0.005)
GAPS = (1, 4)
GAP_ROWS = (6, 90)


@dataclass(frozen=True)
class Background:
    """What is wrong with a record whatever its effect."""

    constants: tuple[Spec, ...]
    wander: Spec
    noise: MeasurementNoise
    gaps: tuple[tuple[tuple[str, ...], int, int], ...]  # outputs, first row, rows

    @property
    def specs(self) -> tuple[Spec, ...]:
        """What acts in the cell."""
        return (*self.constants, self.wander)


def draw_background(rng: Rng) -> Background:
    """Draw everything of a record but its moves and its effect."""
    sites = rng.choice(WRONG, size=int(rng.integers(CONSTANTS[0], CONSTANTS[1] + 1)), replace=False)
    constants = tuple(
        Spec(str(s), "constant", "constant", float(np.expm1(rng.normal(0.0, OFF))), story="wrong constant")
        for s in sites
    )
    return Background(constants, _wander(rng), _noise(rng), _gaps(rng))


def _wander(rng: Rng) -> Spec:
    """Feed grade as a first-order autoregressive course, with a spline between its points."""
    every = 300.0
    count = int(ROWS / every) + 2
    memory = float(np.exp(-every / rng.uniform(*WANDERS_OVER)))
    values = lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], rng.standard_normal(count))
    parameters: Parameters = {"every": ROWS / (count - 1), "values": [float(v) for v in values]}
    return Spec("feed_grade", "time", "wander", float(rng.uniform(*WANDER)), parameters, story="wandering feed")


def _noise(rng: Rng) -> MeasurementNoise:
    """Noise of every second; its memory is told for rows of the record."""
    count = BURN + ROWS
    memory = float(rng.uniform(*MEMORY)) ** (1.0 / EVERY)
    share, scale = float(rng.uniform(*OUTLIERS)), float(rng.uniform(0.7, 1.4))
    values: dict[str, Array] = {}
    for name in OUTPUTS:
        e = np.asarray(lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], rng.standard_normal(count)), dtype=float)
        hit = rng.random(count) < share
        far = rng.uniform(5.0, 12.0, count) * rng.choice([-1.0, 1.0], count)
        values[name] = scale * TYPICAL[name] * np.where(hit, far, e)
    proportional = {name: name == "concentrate_flow_m3_s" for name in OUTPUTS}
    details = {"scale": scale, "memory": memory**EVERY, "outlier_share": share}
    return MeasurementNoise("plant", values, proportional, dict.fromkeys(OUTPUTS, 0.0), 0.0, details)


def _gaps(rng: Rng) -> tuple[tuple[tuple[str, ...], int, int], ...]:
    rows = ROWS // EVERY
    gaps = []
    for _ in range(int(rng.integers(GAPS[0], GAPS[1] + 1))):
        length = int(rng.integers(GAP_ROWS[0], GAP_ROWS[1] + 1))
        outputs = OUTPUTS if rng.random() < 0.5 else (str(rng.choice(OUTPUTS)),)
        gaps.append((tuple(outputs), int(rng.integers(60, rows - length)), length))
    return tuple(gaps)
