"""Protects a constant amount where the model has nothing: a load since the reference, at a site of value zero.

Without it the heater, which would have to give as much less, was named.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.hypotheses.procedure import compare
from adaptive_flot.greybox import Dataset, Model, Scope
from tests.discovery.hypotheses.tank import DT, NOISE, ROWS, tank

LOAD = 400.0
"""Heat that something else takes [W]."""


def loaded_tank() -> Model:
    """The tank with a site for heat that nobody counts."""

    def equations(m: Scope) -> None:
        temperature = m.state("temperature")
        heating = m.site("heater", m.parameter("efficiency") * m.input("power"), "actuator", "offset", unit="W")
        loss = m.site("heat_loss", m.parameter("loss") * (temperature - 293.0), "flow", unit="W")
        load = m.site("load", 0.0 * temperature, "process", "offset", unit="W")
        m.derivative("temperature", (heating - loss - load) / 1.0e5)
        m.output("temperature", m.site("thermometer", temperature, "sensor", "offset", unit="K"))

    return replace(tank(), equations=equations)


def record(name: str, seed: int, load: float) -> Dataset:
    """A record of the plant, by the solution of its equation over each interval."""
    rng = np.random.default_rng(seed)
    power = np.repeat(rng.choice([0.0, 800.0, 1600.0, 2400.0], ROWS // 25), 25).astype(float)
    x, a = np.full(ROWS, 300.0), float(np.exp(-DT * 80.0 / 1.0e5))
    for k in range(1, ROWS):
        rest = 293.0 + (0.9 * power[k] - load) / 80.0
        x[k] = rest + a * (x[k - 1] - rest)
    y = x + NOISE * rng.normal(size=ROWS)
    return Dataset(name, DT * np.arange(ROWS, dtype=float), DT, power[:, None], y[:, None])


def test_a_load_since_the_reference_is_among_what_is_told() -> None:
    """As much less heating is the same record."""
    verdict = compare(loaded_tank(), [record("new", 3, LOAD)], [record("old", 2, 0.0)]).verdict
    told = set(verdict.members) | {(e.effect.site, e.effect.driver) for e in verdict.effects}
    assert verdict.word in ("named", "class"), verdict.reason
    assert ("load", "constant") in told, verdict.reason
    assert f"{LOAD / 100:.0f}" in verdict.reason and "too much" in verdict.reason
