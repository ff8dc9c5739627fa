"""A verdict does not depend on the unit: kelvin or Fahrenheit, watt or kilowatt, temperature or heat as the state."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.fitting.base_fit import prepare
from adaptive_flot.discovery.record.problem import make_problem
from adaptive_flot.discovery.results import Verdict
from adaptive_flot.discovery.search.rounds import scorer_of
from adaptive_flot.greybox import Dataset, Model, Quantity, Scope
from tests.discovery.heated import CAPACITY, DT, ROOM, Truth, heated_tank, moves, tank_record

ROWS = 400


@dataclass(frozen=True)
class Units:
    """The heated tank with an output a T + b, a state s T + t, and other units of its inputs and of a further heat."""

    a: float = 1.0
    b: float = 0.0
    s: float = 1.0
    t: float = 0.0
    power: float = 1.0
    fan: float = 1.0
    other: float = 1.0

    def model(self) -> Model:
        """The same physics: `other_heat` is a site whose own value is zero."""
        tank = heated_tank()

        def equations(m: Scope) -> None:
            temperature = (m.state("temperature") - self.t) / self.s
            heating = m.site("heating", m.parameter("efficiency") * m.input("power"), "actuator") / self.power
            loss = m.site("heat_loss", m.parameter("loss") * (temperature - ROOM))
            other = m.site("other_heat", 0.0 * m.input("power"), "process", "offset") / self.other
            m.derivative("temperature", self.s * (heating - loss + other) / CAPACITY)
            m.output("temperature", m.site("thermometer", self.a * temperature + self.b, "sensor", "offset"))

        low, high = (self.s * v + self.t for v in (273.0, 373.0))
        return replace(
            tank,
            states=(Quantity("temperature", "-", "", low, high, 10.0 * self.s),),
            inputs=(
                Quantity("power", "-", "", 0.0, 1e4 * self.power, 1e3 * self.power),
                Quantity("fan_speed", "-", "", 0.0, 100.0 * self.fan, 5.0 * self.fan),
            ),
            outputs=(Quantity("temperature", "-", "", scale=self.a),),
            equations=equations,
            initial_guess={"temperature": self.s * 310.0 + self.t},
        )

    def record(self, record: Dataset) -> Dataset:
        """What instruments in these units would have written."""
        return replace(record, inputs=record.inputs * [self.power, self.fan], outputs=self.a * record.outputs + self.b)


UNITS = st.sampled_from(
    [
        Units(b=-273.15, t=-273.15),
        Units(a=1.8, b=-459.67, s=1.8, t=-459.67),
        Units(s=CAPACITY, t=-CAPACITY * ROOM),
        Units(power=1e-3, fan=60.0, other=1e-3),
        Units(a=100.0, s=1e3),
    ]
)


def _verdict(units: Units, record: Dataset) -> Verdict:
    return discover(units.model(), units.record(record)).verdict


def _with_other_heat() -> Dataset:
    """400 W more from the middle of the record on."""
    inputs = np.column_stack([moves(ROWS, 500, 3000, 40, 100), moves(ROWS, 5, 20, 25, 200)])
    temperature, seen = 305.0, []
    for k, power in enumerate(inputs[:, 0]):
        for _ in range(10):
            heat = 0.9 * power - 60.0 * (temperature - ROOM) + 400.0 * (k >= ROWS // 2)
            temperature += DT / 10 * heat / CAPACITY
        seen.append(temperature)
    y = np.array(seen) + 0.05 * np.random.default_rng(0).standard_normal(ROWS)
    return Dataset("tank", DT * np.arange(1.0, ROWS + 1), DT, inputs, y[:, None])


@pytest.fixture(scope="module")
def kelvin() -> Verdict:
    return _verdict(Units(), tank_record(Truth(), ROWS))


@settings(max_examples=2)
@given(units=UNITS)
def test_the_draught_is_found_in_any_units(kelvin: Verdict, units: Units) -> None:
    other = _verdict(units, tank_record(Truth(), ROWS))
    assert kelvin.word == other.word == "named"
    one, two = (v.effects[0].effect for v in (kelvin, other))
    assert (one.site, one.driver, one.form) == (two.site, two.driver, two.form)
    assert two.coefficients["exponent"] == pytest.approx(one.coefficients["exponent"], rel=1e-3)
    assert other.error[0].after == pytest.approx(units.a * kelvin.error[0].after, rel=1e-3)


def _scored(units: Units) -> tuple[dict[str, float], float]:
    """Ordinary sizes of the sites, and the first-order gain of a change with time at the site whose value is zero."""
    model, record = units.model(), units.record(_with_other_heat())
    adapted = tuple(p.name for p in model.parameters if p.role == "estimated")
    prepared = prepare(make_problem(record, model, adapted, burn_in=20, guard=5), model)
    assert prepared is not None
    sizes = Responses(*prepared).sizes
    scores = scorer_of(*prepared)[0].scores()
    return sizes, next(s.gain for s in scores if s.candidate.name == ("other_heat", "time"))


def test_a_site_whose_own_value_is_zero_has_a_size_and_is_seen() -> None:
    """A share of nothing is nothing: its size is what moves the outputs as much as they move."""
    watts, gain = _scored(Units())
    kilowatts, same = _scored(Units(other=1e-3))
    assert watts["other_heat"] == pytest.approx(watts["heating"], rel=1e-6) and gain > 100
    assert kilowatts["other_heat"] == pytest.approx(1e-3 * watts["other_heat"], rel=1e-6)
    assert same == pytest.approx(gain, rel=1e-3)
    assert watts["thermometer"] == pytest.approx(float(np.std(_with_other_heat().outputs)), rel=1e-6)
