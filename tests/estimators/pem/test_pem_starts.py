"""A search that may rest in a wrong place is made from several starts, and how many agreed is told."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from adaptive_flot.contracts import Setup, Status
from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope
from estimators.pem import Pem

FREQUENCY, NOISE = 0.5, 0.05


def _equations(m: Scope) -> None:
    m.derivative("x", m.input("u") - m.state("x"))
    m.output("y", m.parameter("level") * m.state("x") + ca.sin(m.parameter("frequency") * m.time))


def _model(frequency: float) -> Model:
    """A sine of unknown frequency beside a linear response: far from the truth a search rests at any side lobe."""
    return Model(
        name="sine",
        states=(Quantity("x", "-", ""),),
        inputs=(Quantity("u", "-", ""),),
        parameters=(
            Parameter("level", 1.0, "-", "", role="estimated"),
            Parameter("frequency", frequency, "1/s", "", lower=0.01, upper=3.0, scale=0.1, role="estimated"),
        ),
        outputs=(Quantity("y", "-", ""),),
        equations=_equations,
        starts_steady=False,
    )


def _record(noise: float = NOISE) -> Dataset:
    rng, time = np.random.default_rng(2), np.arange(200.0)
    u = np.repeat(rng.uniform(-1, 1, 20), 10)
    x = np.zeros(200)
    for k in range(1, 200):
        x[k] = u[k] + (x[k - 1] - u[k]) * np.exp(-1.0)
    y = 2.0 * x + np.sin(FREQUENCY * time) + noise * rng.standard_normal(200)
    return Dataset("sine", time, 1.0, u[:, None], y[:, None])


def _setup(frequency: float) -> Setup:
    return Setup(_model(frequency), 1.0, ("level", "frequency"), ("y",))


def test_further_starts_leave_a_wrong_place_of_rest() -> None:
    one = Pem(_setup(0.8), initial_state="estimated").fit(_record())
    several = Pem(_setup(0.8), initial_state="estimated", starts=12).fit(_record())
    assert one.noise_std[0] > 5 * NOISE and one.agreement == ""
    assert several.values() == pytest.approx([2.0, FREQUENCY], rel=0.02)
    assert several.noise_std[0] == pytest.approx(NOISE, rel=0.2) and several.status is Status.OK
    assert f"{several.agreed} of {several.starts} searches" in several.agreement and several.agreed < several.starts


def test_a_fit_at_the_level_of_the_noise_is_not_tried_again() -> None:
    """The result is that of one start, to the bit."""
    one = Pem(_setup(0.501), initial_state="estimated").fit(_record())
    several = Pem(_setup(0.501), initial_state="estimated", starts=12).fit(_record())
    assert np.array_equal(one.values(), several.values()) and several.starts == 1
    assert one.evaluations == several.evaluations


def test_the_starts_are_the_same_each_time() -> None:
    fits = [Pem(_setup(0.8), initial_state="estimated", starts=12).fit(_record()) for _ in range(2)]
    assert np.array_equal(fits[0].values(), fits[1].values())
