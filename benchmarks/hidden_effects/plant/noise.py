"""Measurement noise of a record: standard deviations of the laboratory cell times a random factor, six kinds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from benchmarks.hidden_effects.cell.simulate import Array
from benchmarks.hidden_effects.cell.sites import OUTPUTS

# Grade: the paper. The others: chosen, of the order of the instruments of a laboratory cell.
TYPICAL = {
    "level_m": 5e-4,
    "tails_flow_m3_s": 5e-7,
    "concentrate_grade": 1e-3,
    "air_recovery": 4e-3,
    "concentrate_flow_m3_s": 0.02,  # of the value
}
KINDS = ("white", "coloured", "outliers", "quantised", "proportional", "process")


@dataclass(frozen=True)
class MeasurementNoise:
    """Noise of one record: values (N,) an output, absolute or a share of the value, and the step it is rounded to."""

    kind: str
    values: dict[str, Array]
    proportional: dict[str, bool]
    step: dict[str, float]
    feed_wander: float = 0.0  # relative standard deviation of a feed grade that nobody can model
    details: dict[str, float] | None = None


def draw_noise(rng: np.random.Generator, count: int, kind: str | None = None) -> MeasurementNoise:
    """Draw kind, sizes and values. `process` adds a slow wander of the feed grade of the order of the grade's noise."""
    kind = kind or str(rng.choice(KINDS, p=[0.3, 0.2, 0.15, 0.1, 0.15, 0.1]))
    scale = float(rng.uniform(0.7, 1.4))
    memory = float(rng.uniform(0.6, 0.93))
    share = float(rng.uniform(0.004, 0.015))
    values: dict[str, Array] = {}
    step = dict.fromkeys(OUTPUTS, 0.0)
    proportional = {name: name == "concentrate_flow_m3_s" for name in OUTPUTS}
    for name in OUTPUTS:
        e = rng.standard_normal(count)
        if kind == "coloured":
            e = np.asarray(lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], e), dtype=np.float64)
        if kind == "outliers":
            hit = rng.random(count) < share
            e = np.where(hit, rng.uniform(5.0, 12.0, count) * rng.choice([-1.0, 1.0], count), e)
        values[name] = scale * TYPICAL[name] * e
    if kind == "quantised":
        step["concentrate_grade"] = float(rng.choice([1e-3, 2e-3, 2.5e-3]))
        step["level_m"] = 1e-3
    if kind == "proportional":  # same noise at a grade of 0.2, an air recovery of 0.15
        for name, at in (("concentrate_grade", 0.2), ("air_recovery", 0.15)):
            values[name] /= at
            proportional[name] = True
    details = {"scale": scale, "memory": memory if kind == "coloured" else 0.0,
               "outlier_share": share if kind == "outliers" else 0.0}  # fmt: skip
    wander = float(rng.uniform(0.006, 0.015)) if kind == "process" else 0.0
    return MeasurementNoise(kind, values, proportional, step, wander, details)
