"""Every estimator and controller keeps its contract with an extended model and adapts the size of an effect by name."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import Model
from adaptive_flot.plugins import CONTROLLERS, ESTIMATORS, load
from adaptive_flot.testing import (
    CONTROLLER_CHECKS,
    ESTIMATOR_CHECKS,
    controller_case,
    estimator_case,
    run_estimator,
)
from tests.contracts.test_contracts import ESTIMATOR_CASES

SWITCH = {"amplitude": 0.1, "on_above": 1.55e-3, "off_below": 1.35e-3}
EXPONENT = "bubble_size_by_air_flow.exponent"


@pytest.fixture(scope="module")
def extended(model: Model) -> Model:
    """Bubbles grow with air, the feed is late, the valve sticks, the flow lags, the froth changes, air switches."""
    return model.with_effects(
        [
            Effect("bubble_size", "air_flow", "power", {"exponent": 0.3}, {"reference": 1.5e-3}),
            Effect(
                "feed_flow", "delay", "delay", {"amplitude": 1.0, "dead_time": 9.0}, {"scale": 1.67e-4, "stages": 2}
            ),
            Effect("tails_valve", "lag", "stiction", {"amplitude": 1.0, "band": 1e-6}, {"scale": 1.6e-4}),
            Effect("concentrate_flow", "lag", "lag", {"amplitude": 0.8, "time_constant": 12.0}, {"scale": 1e-6}),
            Effect("coalescence", "time", "ramp", {"amplitude": 0.1, "onset": 10.0, "duration": 20.0}),
            Effect("floatability_gangue", "air_flow", "relay", SWITCH),
        ]
    )


@pytest.mark.parametrize("name", ESTIMATORS)
def test_estimator_with_an_extended_model(name: str, extended: Model) -> None:
    """All checks of the kit, with n, C and the exponent of the effect adapted."""
    address, options = ESTIMATOR_CASES[name]
    if name == "mhe":
        options = {"window_s": 6, "solve_every_s": 4}  # each interval of the window has the whole extended model
    names = ("growth_exponent", "coalescence_rate", EXPONENT)
    case = estimator_case(load(address, ESTIMATORS, "estimator"), model=extended, parameters=names, **options)
    for check in ESTIMATOR_CHECKS:
        check(case)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_controller_with_an_extended_model(name: str, extended: Model) -> None:
    options: dict[str, Any] = {"horizon": 6, "solver": "fatrop"} if name == "economic_mpc" else {}
    case = controller_case(load(name, CONTROLLERS, "controller"), model=extended, **options)
    for check in CONTROLLER_CHECKS:
        check(case)


def test_a_known_effect_is_predicted(extended: Model) -> None:
    """Fixed with the true parameters: what is left is the noise of the record (0.1 %), whatever moves in time."""
    case = estimator_case(load("oracle", ESTIMATORS, "estimator"), model=extended)
    truth = np.tile(extended.parameter_values, (len(case.samples), 1))
    truth[:, extended.index("parameters", "n")] *= np.linspace(1.0, 1.02, len(case.samples))
    oracle = estimator_case(
        lambda setup: load("oracle", ESTIMATORS, "estimator")(type(setup)(**{**vars(setup), "truth": truth})),
        model=extended,
    )
    _, estimates = run_estimator(oracle.estimator, oracle.estimator.init(oracle.prior), oracle.samples)
    relative = np.array([e.innovation / e.prediction for e in estimates])
    assert np.abs(relative).max() < 5e-3
