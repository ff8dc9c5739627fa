"""Protects a user whose model runs off from a message on units alone: it says which state leaves its range, when."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.discover import discover
from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope


def rotor(growth: float) -> Model:
    """A speed that grows, or falls, by a share of itself: from 1 rad/s it is 2 rad/s after log(2) / growth."""

    def equations(m: Scope) -> None:
        omega = m.state("omega")
        m.derivative("omega", m.parameter("growth") * omega + 1e-3 * m.site("torque", m.input("voltage"), "actuator"))
        m.output("speed", m.site("tachometer", omega, "sensor", unit="rad/s"))

    return Model(
        name="rotor",
        states=(Quantity("omega", "rad/s", "", 0.5, 15.0, 1.0),),
        inputs=(Quantity("voltage", "V", "", -10.0, 10.0, 1.0),),
        parameters=(Parameter("growth", growth, "1/s", "guess", "g", -0.02, 2.0, 0.01, role="estimated"),),
        outputs=(Quantity("speed", "rad/s", "", 0.0, 20.0, 1.0),),
        equations=equations,
        starts_steady=False,
        initial_guess={"omega": 1.0},
    )


def record() -> Dataset:
    rng, rows = np.random.default_rng(1), 600
    volts = np.repeat(rng.uniform(-1.0, 1.0, rows // 20), 20)
    speed = 1.0 + 0.1 * volts + 0.01 * rng.standard_normal(rows)
    return Dataset("rotor", np.arange(rows, dtype=float), 1.0, volts[:, None], speed[:, None])


def test_the_state_that_leaves_its_range_is_said_and_when() -> None:
    """A turbine that stalled was `insufficient`, and its user was sent to check units that were right."""
    model = rotor(2.0)
    model = replace(model, parameters=(replace(model.parameters[0], lower=1.9),))
    verdict = discover(model, record()).verdict
    assert verdict.word == "insufficient"
    assert "the model 'rotor' can not simulate the record: from its own values omega leaves [0.5, 15] rad/s at 2 s" in (
        verdict.reason
    )


@pytest.mark.parametrize("growth", [-0.01])
def test_nothing_is_said_of_a_model_that_stays(growth: float) -> None:
    verdict = discover(rotor(growth), record()).verdict
    assert "leaves" not in verdict.reason
