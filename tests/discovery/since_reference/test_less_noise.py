"""Protects: a store takes up slowly what is switched for a time, and process noise does not hide that.

A battery's cell whose fan stops twice, simulated here by Euler's rule. From row to row its temperature hardly shows it.
"""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.procedure import Comparison
from adaptive_flot.discovery.innovations.filter.refit import Refitter
from adaptive_flot.discovery.since_reference import process_noise
from adaptive_flot.discovery.since_reference.changes import find_changes
from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope

ROWS, DT, CAPACITY, COOLING = 1200, 10.0, 830.0, 0.36
NOISE, STEP = 0.08, 0.05
"""Of the thermometer [K], and its resolution."""
SPELLS = ((3000.0, 5400.0), (8000.0, 9800.0))
LEFT = 0.5
"""Share of the cooling that is left in these."""


def body() -> Model:
    """Heat in, cooled by a fan."""

    def equations(m: Scope) -> None:
        temperature, ambient = m.state("temperature"), m.input("ambient")
        heat = m.site("heat", m.parameter("resistance") * m.input("current") ** 2, "process", unit="W")
        cooling = m.site("cooling", m.parameter("cooling"), "process", unit="W/K")
        m.derivative("temperature", (heat - cooling * (temperature - ambient)) / CAPACITY)
        m.output("temperature", m.site("thermometer", temperature, "sensor", "offset", unit="degC"))

    def estimated(name: str, value: float, unit: str) -> Parameter:
        return Parameter(name, value, unit, "", lower=value / 20, upper=20 * value, scale=value / 5, role="estimated")

    return Model(
        name="body",
        states=(Quantity("temperature", "degC", "", -20.0, 90.0, scale=3.0),),
        inputs=(
            Quantity("current", "A", "", -80.0, 80.0),
            Quantity("ambient", "degC", "", -20.0, 50.0, scale=3.0, movable=False),
        ),
        parameters=(estimated("resistance", 1.5e-3, "ohm"), estimated("cooling", 0.3, "W/K")),
        outputs=(Quantity("temperature", "degC", "", scale=3.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"temperature": 20.0},
    )


def record(name: str, seed: int, *, stops: bool) -> Dataset:
    rng = np.random.default_rng(seed)
    time = DT * np.arange(ROWS, dtype=float)
    current = np.repeat(rng.uniform(-60, 60, ROWS // 24), 24)
    ambient = 18.0 + 2.0 * np.sin(2 * np.pi * time / 15_000.0 + seed)
    temperature, shown = 21.0, np.zeros(ROWS)
    for k in range(ROWS):
        if k:
            stopped = stops and any(a <= time[k] < b for a, b in SPELLS)
            loss = COOLING * (LEFT if stopped else 1.0) * (temperature - ambient[k])
            temperature += DT * (1.6e-3 * current[k] ** 2 - loss) / CAPACITY
        shown[k] = np.round((temperature + NOISE * rng.normal()) / STEP) * STEP
    return Dataset(name, time, DT, np.column_stack([current, ambient]), shown[:, None])


def changed() -> Comparison:
    new, old = record("new", 5, stops=True), record("old", 4, stops=False)
    return find_changes(body(), [new], [old], processes=1)


def test_a_fan_that_stops_twice_is_told_with_its_size_and_times() -> None:
    verdict = changed().verdict
    assert verdict.word == "named", verdict.reason
    (told,) = verdict.effects
    assert told.effect.site == "cooling"
    values = told.effect.coefficients
    assert np.exp(values["amplitude"]) == pytest.approx(LEFT, rel=0.1)
    for k, (begin, end) in enumerate(SPELLS, start=1):
        assert values[f"on_{k}"] == pytest.approx(begin, abs=150.0)
        assert values[f"on_{k}"] + values[f"for_{k}"] == pytest.approx(end, abs=150.0)


def test_it_is_hidden_where_noise_is_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the second look is for: else the test above protects nothing."""
    monkeypatch.setattr(process_noise, "_is_hidden", lambda *_: False)
    assert changed().verdict.word == "abstain"


def test_noise_that_is_held_is_that_of_a_fit_which_holds_it() -> None:
    data, size = record("old", 4, stops=False), (0.01, 1.2)
    floor = np.array([NOISE])
    own, held = (Refitter(body(), data, (0,), floor, ("cooling",), held=h) for h in (None, size))
    p = body().parameter_values
    first, second = own.fit(p, size, hold_noise=True), held.fit(p)
    assert second.size == size
    np.testing.assert_array_equal(first.p, second.p)
    assert held.at(p).size == size
