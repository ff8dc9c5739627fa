"""What enters a balance while its driver is zero: a change by an amount, which no factor on nothing can be."""

import numpy as np
import pytest

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.verdict.conclude import SIZES_WITH_PROCESS_NOISE
from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope

DT, GUESTS = 60.0, ((9000.0, 12_000.0), (24_000.0, 27_600.0))


def record(seed: int = 0, rows: int = 700) -> Dataset:
    """Carbon dioxide of a room; people are counted, six guests are not, and come while nobody else is there."""
    rng = np.random.default_rng(seed)
    fan = np.repeat(rng.choice([0.2, 0.5, 1.0], rows // 35 + 1), 35)[:rows]
    people = np.repeat(rng.integers(0, 8, rows // 50 + 1), 50)[:rows].astype(float)
    guests, level, y = np.zeros(rows), 600.0, np.zeros(rows)
    for a, b in GUESTS:
        inside = (DT * np.arange(rows) > a) & (DT * np.arange(rows) <= b)
        guests[inside], people[inside] = 6.0, 0.0
    for k in range(rows):
        y[k] = level
        for _ in range(10 if k + 1 < rows else 0):
            source = 1e6 * 0.02 * (people[k + 1] + guests[k + 1])
            air = 350.0 * fan[k + 1] + 60.0
            level += DT / 10 * (source - air * (level - 420.0)) / (3600 * 180.0) + 0.2 * rng.standard_normal()
    y += 4.0 * rng.standard_normal(rows)
    return Dataset("room", DT * np.arange(rows, dtype=float), DT, np.column_stack([fan, people]), y[:, None])


def model() -> Model:
    """Fan, leaks, people and a volume."""

    def equations(m: Scope) -> None:
        level = m.state("level")
        air = m.site("fan", m.parameter("fan_air") * m.input("fan"), "actuator", unit="m3/h")
        air += m.site("infiltration", m.parameter("leaks"), unit="m3/h")
        breath = m.site("breath", m.parameter("breath") * m.input("people"), unit="m3/h")
        m.derivative("level", (1e6 * breath - air * (level - 420.0)) / (3600.0 * 180.0))
        m.output("level", m.site("sensor", level, "sensor", "offset", unit="ppm"))

    def constant(name: str, value: float) -> Parameter:
        return Parameter(name, value, "m3/h", "", lower=value / 10, upper=10 * value, scale=value / 3, role="estimated")

    return Model(
        name="room",
        states=(Quantity("level", "ppm", "", scale=200.0),),
        inputs=(Quantity("fan", "-", "", 0.0, 1.0), Quantity("people", "-", "", 0.0, 20.0)),
        parameters=(constant("fan_air", 400.0), constant("leaks", 50.0), constant("breath", 0.02)),
        outputs=(Quantity("level", "ppm", "", scale=200.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"level": 600.0},
    )


def test_guests_that_nobody_counts_are_told_as_an_amount_with_their_times() -> None:
    """Truth: 6 x 0.02 = 0.12 m3/h more. A fan that stands still looks much the same, and must not be named."""
    verdict = discover(model(), record()).verdict
    assert verdict.word == "named", verdict.reason
    (named,) = verdict.effects
    told, (low, high) = named.effect, named.interval95["amplitude"]
    assert (told.site, told.form, told.mode) == ("breath", "switch", "offset"), verdict.reason
    assert told.coefficients["amplitude"] == pytest.approx(0.12, rel=0.1)
    assert low < 0.12 < high and high - low < 0.03
    # the sentence has the same size, and says which fit it is of
    assert f"{told.coefficients['amplitude']:.3g} m3/h more" in verdict.reason
    assert SIZES_WITH_PROCESS_NOISE in verdict.notes
    for k, (a, b) in enumerate(GUESTS, start=1):
        assert told.coefficients[f"on_{k}"] == pytest.approx(a, abs=2 * DT)
        assert told.coefficients[f"for_{k}"] == pytest.approx(b - a, abs=3 * DT)
    assert "m3/h more while something is switched" in verdict.reason
