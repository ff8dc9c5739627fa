"""Protects a constant amount where the model has nothing: a load since the reference, at a site of value zero.

Without it the heater, which would have to give as much less, was named.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.families import hypotheses
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


def cell_with_a_feed(model: Model) -> Model:
    """The tank, whose power is a feed that may go either way: a current into and out of a battery."""

    def equations(m: Scope) -> None:
        temperature = m.state("temperature")
        feed = m.site("feed", m.input("power"), "feed", "offset", unit="W")
        m.derivative("temperature", (feed - m.parameter("loss") * (temperature - 293.0)) / 1.0e5)
        m.output("temperature", m.site("thermometer", temperature, "sensor", "offset", unit="K"))

    return replace(model, equations=equations)


@pytest.mark.parametrize(("low", "found"), [(-800.0, True), (0.0, False), (100.0, False)])
def test_a_feed_that_goes_both_ways_may_have_a_constant_amount(low: float, found: bool) -> None:
    """A current sensor that shows 0.25 A too little had no hypothesis: a factor is none of what goes both ways."""
    model = cell_with_a_feed(tank())
    feed = np.linspace(low, 900.0, ROWS)
    seen = {"feed": feed, "thermometer": np.linspace(293.0, 310.0, ROWS)}
    all_of_them = hypotheses(model, seen, {"power": feed, "temperature": seen["thermometer"]}, DT, DT * ROWS)
    amounts = [h for h in all_of_them if h.site == "feed" and h.driver == "constant" and h.effect.mode == "offset"]
    assert bool(amounts) == found, [h.label for h in all_of_them if h.site == "feed"]
