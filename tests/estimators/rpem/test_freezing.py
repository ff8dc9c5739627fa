"""Freezing: a direction on which the recent data say nothing is held, the others go on."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup, Status
from adaptive_flot.greybox.model import FloatArray
from estimators.rpem.estimator import Rpem
from estimators.shared.information import Information
from tests.estimators import toys
from tests.estimators.conftest import CellCase, replay

NOISE = 0.1


def starved_record(seed: int = 1) -> list[Sample]:
    """y = th0 u0 + th1 u1 with both inputs moving, then u0 = u1 only (60 samples), then both again."""
    generator = np.random.default_rng(seed)
    inputs = generator.normal(size=(180, 2))
    inputs[60:120, 1] = inputs[60:120, 0]
    theta = np.array([1.0, 2.0]) + np.linspace(0, 0.5, 180)[:, None]
    outputs = (inputs * theta).sum(axis=1) + NOISE * generator.normal(size=180)
    return [Sample(k + 1.0, u, np.array([y])) for k, (u, y) in enumerate(zip(inputs, outputs, strict=True))]


def run(samples: list[Sample], freeze_s: float | None) -> list[Estimate]:
    model = toys.linear(2, value=1.0)
    setup = Setup(model, 1.0, model.names("parameters"), model.names("outputs"))
    prior = Prior(0.0, np.zeros(1), np.array([1.0, 2.0]), 0.01 * np.eye(2), np.full(1, NOISE))
    return replay(Rpem(setup, forgetting=0.9, forget_to=0.3, freeze_s=freeze_s), prior, tuple(samples))


def test_the_starved_direction_is_held_and_the_other_goes_on() -> None:
    """While u0 = u1 only th0 + th1 is measured: their difference does not move, their sum follows, the status says so.

    The memory is 10 s, so the first samples of that time still know the difference from those before.  What the
    difference still moves by is what is left of them.
    """
    tracked = run(starved_record(), freeze_s=10.0)
    theta = np.array([e.parameters for e in tracked])
    assert {e.status for e in tracked[110:120]} == {Status.LOW_INFORMATION}
    np.testing.assert_allclose(theta[105:120, 0] - theta[105:120, 1], theta[104, 0] - theta[104, 1], atol=1e-4)
    assert np.abs(theta[110:120].sum(axis=1) - (3.0 + np.linspace(0, 1, 180)[110:120])).max() < 0.15
    assert {e.status for e in tracked[150:]} == {Status.OK}, "it thaws when the inputs move again"
    assert np.abs(theta[-1] - [1.5, 2.5]).max() < 0.15


def test_where_data_say_enough_nothing_changes() -> None:
    """A memory so long that no direction is ever starved: the estimates of RPEM without freezing."""
    for a, b in zip(run(starved_record(), 1e6), run(starved_record(), None), strict=True):
        assert a.status is Status.OK
        np.testing.assert_allclose(a.parameters, b.parameters, rtol=1e-9)
        np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-9)


def test_the_covariance_of_a_held_direction_grows_to_what_is_forgotten_to() -> None:
    """Held is not known: the estimate says that it knows the direction only as well as A."""
    tracked = run(starved_record(), freeze_s=10.0)
    difference = np.array([1.0, -1.0]) / np.sqrt(2)
    spread = [float(difference @ e.covariance @ difference) for e in tracked]
    assert spread[119] > 10 * spread[59]
    assert spread[119] <= 0.3**2 * (1 + 1e-9)


@given(angle=st.floats(0.0, 3.14), low=st.floats(0.0, 0.99), high=st.floats(1.01, 1e6), scale=st.floats(1e-4, 1e4))
def test_free_directions_are_the_eigenvectors_that_say_more_than_the_alternative(
    angle: float, low: float, high: float, scale: float
) -> None:
    """Whatever the units: information is judged relative to A, and the projection is one."""
    v = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    units = np.array([1.0, scale])
    information: FloatArray = (v * [low, high]) @ v.T / np.outer(units, units)
    projection, starved = Information(np.diag(units**2), 60.0).free_directions(information)
    assert starved
    np.testing.assert_allclose(projection @ (units * v[:, 1]), units * v[:, 1], rtol=1e-6, atol=1e-9 * scale)
    np.testing.assert_allclose(projection @ (units * v[:, 0]), 0.0, atol=1e-6 * max(1.0, scale))


def test_a_cell_held_still_freezes_the_ridge_and_keeps_predicting(cell_case: CellCase) -> None:
    """The case of an MPC at its constraints: one operating point tells one combination of n and C, not both."""
    setup, prior = cell_case.setup, cell_case.prior
    generator = np.random.default_rng(2)
    still = [Sample(k + 1.0, cell_case.inputs[0], np.full(len(setup.model.outputs), np.nan)) for k in range(400)]
    truth = prior.parameters * [1.02, 0.97]
    _, blind = _predict(setup, prior, truth, still)
    for sample, y in zip(still, blind, strict=True):
        sample.outputs[0] = y + 1e-3 * generator.standard_normal()
    estimator = Rpem(setup, gradient="recursive", forgetting=0.9, forget_to=0.05, freeze_s=60.0)
    tracked = replay(estimator, prior, tuple(still))
    assert {e.status for e in tracked[300:]} == {Status.LOW_INFORMATION}
    assert np.abs([e.prediction[0] for e in tracked[300:]] - blind[300:]).max() < 2e-3


def _predict(setup: Setup, prior: Prior, theta: FloatArray, samples: list[Sample]) -> tuple[list[Estimate], FloatArray]:
    """Free run with the true parameters."""
    sure = Prior(prior.time, prior.state, theta, 1e-24 * prior.covariance, prior.noise_std)
    tracked = replay(Rpem(setup), sure, tuple(samples))
    return tracked, np.array([e.prediction[0] for e in tracked])


@pytest.mark.parametrize("seed", [2, 3])
def test_missing_samples_do_not_thaw_or_starve_by_themselves(seed: int) -> None:
    """The memory is in time: a gap lets information fade, and what comes after it is judged anew."""
    samples = starved_record(seed)[:60]
    gap = [Sample(61.0 + k, np.ones(2), np.full(1, np.nan)) for k in range(200)]
    tracked = run([*samples, *gap, Sample(261.0, np.array([1.0, 0.0]), np.array([1.0]))], freeze_s=10.0)
    assert tracked[59].status is Status.OK
    assert {e.status for e in tracked[60:-1]} == {Status.MISSING}
    assert tracked[-1].status is Status.LOW_INFORMATION
    np.testing.assert_array_equal(tracked[-1].parameters, tracked[59].parameters)
