"""Posterior Cramer-Rao bound: for linear models it is the exact posterior covariance, found by least squares."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.contracts import Prior
from adaptive_flot.greybox.filtering.cramer_rao_bound import (
    ParameterDrift,
    drift_of_time_profile,
    linearise_trajectory,
    posterior_cramer_rao_bound,
    random_walk,
)
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.stepper import Stepper
from tests.estimators import toys
from tests.estimators.gaussian import linear_record, posterior


def test_random_walk_of_a_linear_model_has_its_exact_posterior_covariance() -> None:
    """With missing samples and two rates; against one least-squares problem over the whole record."""
    record = linear_record(1)
    setup, samples = record.setup, record.samples
    inputs = np.array([s.inputs for s in samples])
    parameters = np.tile(setup.model.parameter_values, (len(samples), 1))
    stepper = Stepper(setup.model, setup.dt)
    linear = linearise_trajectory(stepper, setup.parameters, np.zeros(2), inputs, parameters)
    measured = np.isfinite([s.outputs for s in samples])
    noise = np.where(measured, record.prior.noise_std, np.nan)
    std = np.array([0.05, 0.2])
    assert record.prior.joint_covariance is not None
    found = posterior_cramer_rao_bound(linear, random_walk(len(samples), std), noise, record.prior.joint_covariance)
    Q = np.diag([0.0, 0.0, *std**2])
    # the bound at a sample knows the samples until then, so each instant is a record of its own
    for count in (1, 8, 25):
        part = type(record)(setup, record.prior, samples[:count])
        np.testing.assert_allclose(found[count - 1], posterior(part, Q)[1][-1], rtol=1e-8, atol=1e-12)


def straight(theta: FloatArray, noise: float, start_std: float) -> tuple[FloatArray, FloatArray]:
    """Bound of y = theta u for a known path of theta (N, 1), with the inputs u (N, 1)."""
    model = toys.linear(1, value=1.0)
    inputs = np.random.default_rng(2).normal(size=(len(theta), 1))
    linear = linearise_trajectory(Stepper(model, 1.0), ["th0"], np.zeros(1), inputs, theta)
    start = np.diag([0.0, start_std**2])
    return posterior_cramer_rao_bound(linear, drift_of_time_profile(theta), np.full((len(theta), 1), noise), start)[
        :, 1:, 1:
    ], inputs


def test_a_constant_parameter_has_the_variance_of_linear_regression() -> None:
    found, u = straight(np.ones((60, 1)), 0.1, 2.0)
    np.testing.assert_allclose(found[:, 0, 0], 1 / (1 / 4.0 + np.cumsum(u[:, 0] ** 2) / 0.1**2), rtol=1e-10)


def test_a_ramp_told_in_time_costs_one_unknown_slope() -> None:
    """Rest, ramp, rest: the unknowns are the first value and the slope; their normal equations give the same."""
    rows, first, last = 90, 30, 60
    share = np.clip(np.arange(rows) - first + 1.0, 0, last - first)
    found, u = straight(1.0 + 0.01 * share[:, None], 0.1, 2.0)
    prior = np.diag([2.0, 0.01]) ** 2
    for k in (10, 45, 89):
        regressors = np.column_stack([np.ones(k + 1), share[: k + 1]]) * u[: k + 1]
        covariance = np.linalg.inv(np.linalg.inv(prior) + regressors.T @ regressors / 0.1**2)
        now = np.array([1.0, share[k]])
        np.testing.assert_allclose(found[k, 0, 0], now @ covariance @ now, rtol=1e-8)


def test_a_step_is_one_unknown_move() -> None:
    theta = np.ones((20, 2))
    theta[7:, 0] = 1.5
    drift = drift_of_time_profile(theta)
    np.testing.assert_allclose(drift.variance[7], [0.25, 0.0])
    assert not drift.variance[np.arange(20) != 7].any()
    assert drift.keep[:, 1].all() and set(np.flatnonzero(drift.keep[:, 0] == 0)) == {7, 8}


def test_a_random_walk_is_renewed_at_every_interval_with_the_size_of_its_moves() -> None:
    moves = np.random.default_rng(1).normal(size=(500, 2)) * [0.1, 0.3]
    drift = drift_of_time_profile(np.cumsum(moves, axis=0))
    assert not drift.keep[1:].any()
    np.testing.assert_allclose(np.sqrt(drift.variance[1:]), np.tile([0.1, 0.3], (499, 1)), rtol=0.1)


@pytest.mark.parametrize("more", [0, 1])
def test_another_sensor_never_raises_the_bound(more: int) -> None:
    record = linear_record(3)
    model = record.setup.model
    inputs = np.array([s.inputs for s in record.samples])
    linear = linearise_trajectory(
        Stepper(model, 1.0), ["th0", "th1"], np.zeros(2), inputs, np.tile(model.parameter_values, (25, 1))
    )
    prior: Prior = record.prior
    assert prior.joint_covariance is not None
    one = np.full((25, 2), np.nan)
    one[:, more] = 0.3
    drift = ParameterDrift(np.zeros((25, 2)), np.full((25, 2), 0.01))
    alone = posterior_cramer_rao_bound(linear, drift, one, prior.joint_covariance)
    both = posterior_cramer_rao_bound(linear, drift, np.full((25, 2), 0.3), prior.joint_covariance)
    gains = np.linalg.eigvalsh(alone - both)
    assert gains.min() > -1e-12 and gains.max() > 1e-3


def test_more_rows_than_one_call_takes_are_linearised_as_few_are() -> None:
    model = toys.decay()
    inputs = np.random.default_rng(4).normal(size=(701, 1))
    p = np.tile(model.parameter_values, (701, 1))
    stepper = Stepper(model, 1.0)
    whole = linearise_trajectory(stepper, ["a"], np.array([1.0]), inputs, p)
    head = linearise_trajectory(stepper, ["a"], np.array([1.0]), inputs[:10], p[:10])
    np.testing.assert_allclose(whole.F[:10], head.F, rtol=1e-12)
    x = stepper.simulate(np.array([1.0]), inputs, p).states[599]
    tail = linearise_trajectory(stepper, ["a"], x, inputs[600:], p[600:], t0=600.0)
    np.testing.assert_allclose(whole.F[600:], tail.F, rtol=1e-12)
    np.testing.assert_allclose(whole.H[600:], tail.H, rtol=1e-12)
