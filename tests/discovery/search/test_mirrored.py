"""Protects two lags at one end against the two at the other: in a linear plant they are the same record."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.discovery.discover import discover
from adaptive_flot.greybox import Dataset, Effect, Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.stepping.record import RecordSimulator

DT, ROWS, NOISE, TAU = 1.0, 700, 0.02, 6.0


def plates() -> Model:
    """Two plates that exchange heat, each with a heater and a thermometer."""

    def equations(m: Scope) -> None:
        a, b = m.state("a"), m.state("b")
        between = m.site("exchange", m.parameter("exchange_rate") * (a - b), "process", "offset")
        for name, own, sign in (("a", a, -1.0), ("b", b, 1.0)):
            heater = m.site(f"heater_{name}", m.input(f"power_{name}"), "actuator", "offset")
            m.derivative(name, (m.parameter("gain") * heater - own) / m.parameter("tau") + sign * between)
            m.output(f"shown_{name}", m.site(f"thermometer_{name}", own, "sensor", "offset"))

    return Model(
        name="plates",
        states=tuple(Quantity(n, "-", "", -50.0, 50.0, 1.0) for n in "ab"),
        inputs=tuple(Quantity(f"power_{n}", "-", "", -5.0, 5.0, 1.0) for n in "ab"),
        parameters=(
            Parameter("gain", 2.0, "-", "", "K", 0.1, 10.0, 0.5, role="estimated"),
            Parameter("tau", 30.0, "s", "", "tau", 1.0, 300.0, 5.0, role="estimated"),
            Parameter("exchange_rate", 0.01, "1/s", "", "h", 1e-4, 1.0, 5e-3, role="estimated"),
        ),
        outputs=tuple(Quantity(f"shown_{n}", "-", "", -50.0, 50.0, 1.0) for n in "ab"),
        equations=equations,
    )


@pytest.mark.parametrize("end", ["heater", "thermometer"])
def test_lags_of_all_inputs_and_lags_of_all_outputs_are_a_class(end: str) -> None:
    rng = np.random.default_rng(4)
    power = np.column_stack([np.repeat(rng.uniform(-2, 2, ROWS // 20), 20) for _ in range(2)])
    late = [Effect(f"{end}_{n}", "lag", "lag", {"amplitude": 1.0, "time_constant": TAU}, {"scale": 1.0}) for n in "ab"]
    plant = plates().with_effects(late)
    data = Dataset("plates", DT * np.arange(ROWS, dtype=float), DT, power, np.zeros((ROWS, 2)))
    start = np.concatenate([np.zeros(2), np.zeros(len(plant.states) - 2)])
    y = RecordSimulator(plant, DT).outputs(data, start, plant.parameter_values)
    y = y + NOISE * rng.standard_normal(y.shape)
    data = Dataset("plates", data.time, DT, power, y)
    verdict = discover(plates(), data).verdict
    assert verdict.word == "class", verdict.reason
    told = set(verdict.members)
    assert {(f"{where}_{n}", "lag") for where in ("heater", "thermometer") for n in "ab"} <= told, told
