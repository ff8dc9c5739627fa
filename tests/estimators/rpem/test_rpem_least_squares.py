"""RPEM of a model that is linear in its parameters is recursive least squares with forgetting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup, Status
from adaptive_flot.greybox.model import FloatArray
from estimators.rpem.estimator import Rpem
from tests.estimators import toys


@dataclass(frozen=True)
class Case:
    """Regressors (N, m, q), measurements (N, m), prior, noise levels (m,) and forgetting."""

    regressors: FloatArray
    measured: FloatArray
    theta: FloatArray
    covariance: FloatArray
    noise: FloatArray
    forgetting: float


def make_case(seed: int, q: int, m: int, forgetting: float, rows: int = 60) -> Case:
    generator = np.random.default_rng(seed)
    regressors = generator.normal(size=(rows, m, q))
    noise = generator.uniform(0.2, 2.0, size=m)
    truth = generator.normal(size=q)
    measured = regressors @ truth + noise * generator.normal(size=(rows, m))
    half = generator.normal(size=(q, q))
    return Case(regressors, measured, generator.normal(size=q), half @ half.T + np.eye(q), noise, forgetting)


def run_rpem(case: Case, **options: float) -> list[Estimate]:
    rows, m, q = case.regressors.shape
    model = toys.linear(q, m)
    setup = Setup(model, 1.0, model.names("parameters"), model.names("outputs"))
    estimator = Rpem(setup, forgetting=case.forgetting, **options)  # type: ignore[arg-type]
    state = estimator.init(Prior(0.0, np.zeros(1), case.theta, case.covariance, case.noise))
    tracked = []
    for k in range(rows):
        state, estimate = estimator.update(state, Sample(k + 1.0, case.regressors[k].ravel(), case.measured[k]))
        tracked.append(estimate)
    return tracked


def block_least_squares(case: Case) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Textbook recursion with a matrix inverse: estimates (N, q), covariances (N, q, q), innovation std (N, m)."""
    theta, P, R = case.theta, case.covariance, np.diag(case.noise**2)
    thetas, covariances, expected = [], [], []
    for psi, y in zip(case.regressors, case.measured, strict=True):
        S = case.forgetting * R + psi @ P @ psi.T
        expected.append(np.sqrt(np.diag(S / case.forgetting)))
        K = P @ psi.T @ np.linalg.inv(S)
        theta = theta + K @ (y - psi @ theta)
        P = (P - K @ psi @ P) / case.forgetting
        thetas.append(theta)
        covariances.append(P)
    return np.array(thetas), np.array(covariances), np.array(expected)


@pytest.mark.parametrize("forgetting", [1.0, 0.98, 0.9])
@pytest.mark.parametrize(("q", "m"), [(1, 1), (3, 1), (2, 2), (3, 4)])
def test_estimates_and_covariances_are_those_of_the_block_recursion(q: int, m: int, forgetting: float) -> None:
    case = make_case(7, q, m, forgetting)
    tracked = run_rpem(case)
    thetas, covariances, _ = block_least_squares(case)
    np.testing.assert_allclose([e.parameters for e in tracked], thetas, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose([e.covariance for e in tracked], covariances, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize(("q", "m"), [(2, 1), (2, 3)])
def test_innovation_std_is_that_of_the_whole_innovation_before_any_output_was_used(q: int, m: int) -> None:
    case = make_case(3, q, m, 0.97)
    tracked = run_rpem(case)
    np.testing.assert_allclose([e.innovation_std for e in tracked], block_least_squares(case)[2], rtol=1e-10)


@given(seed=st.integers(0, 10**6), q=st.integers(1, 4), m=st.integers(1, 3), forgetting=st.floats(0.8, 1.0))
def test_last_estimate_minimises_the_forgetting_criterion(seed: int, q: int, m: int, forgetting: float) -> None:
    """Solved at once: sum lambda^(N-k) |y_k - psi_k theta|^2 / sigma^2 + lambda^N |theta - theta_0|^2 in P_0^-1."""
    case = make_case(seed, q, m, forgetting, rows=25)
    weight = forgetting ** np.arange(len(case.measured) - 1, -1, -1)[:, None]
    rows = (case.regressors / case.noise[:, None] * np.sqrt(weight)[:, :, None]).reshape(-1, q)
    right = (case.measured / case.noise * np.sqrt(weight)).ravel()
    prior = forgetting ** len(case.measured) * np.linalg.inv(case.covariance)
    information = rows.T @ rows + prior
    last = run_rpem(case)[-1]
    np.testing.assert_allclose(last.parameters, np.linalg.solve(information, rows.T @ right + prior @ case.theta))
    np.testing.assert_allclose(last.covariance, np.linalg.inv(information), rtol=1e-8)


def test_a_missing_output_only_leaves_its_term_out() -> None:
    """A sample with one of two outputs is a sample of that output alone."""
    case = make_case(5, 2, 2, 0.95)
    case.measured[::3, 1] = np.nan
    theta, P = case.theta, case.covariance
    for psi, y in zip(case.regressors, case.measured, strict=True):
        here = np.isfinite(y)
        S = 0.95 * np.diag(case.noise[here] ** 2) + psi[here] @ P @ psi[here].T
        K = P @ psi[here].T @ np.linalg.inv(S)
        theta, P = theta + K @ (y[here] - psi[here] @ theta), (P - K @ psi[here] @ P) / 0.95
    last = run_rpem(case)[-1]
    np.testing.assert_allclose(last.parameters, theta, rtol=1e-10)
    np.testing.assert_allclose(last.covariance, P, rtol=1e-10)


def test_a_sample_without_measurement_changes_and_forgets_nothing() -> None:
    """Rows without any measurement can be put anywhere in the record: the others give the same estimates."""
    case = make_case(6, 2, 2, 0.9, rows=20)
    gaps = np.repeat(np.arange(20), 2)
    measured = case.measured[gaps]
    measured[1::2] = np.nan
    with_gaps = Case(case.regressors[gaps], measured, case.theta, case.covariance, case.noise, 0.9)
    tracked, plain = run_rpem(with_gaps), run_rpem(case)
    for k, e in enumerate(plain):
        for same in tracked[2 * k : 2 * k + 2]:
            np.testing.assert_array_equal(same.parameters, e.parameters)
            np.testing.assert_array_equal(same.covariance, e.covariance)
    assert [e.status for e in tracked] == [Status.OK, Status.MISSING] * 20


def test_l0_scale_multiplies_the_prior_covariance() -> None:
    case = make_case(8, 2, 1, 0.99)
    wide = Case(case.regressors, case.measured, case.theta, 5.0 * case.covariance, case.noise, 0.99)
    for a, b in zip(run_rpem(case, l0_scale=5.0), run_rpem(wide), strict=True):
        np.testing.assert_array_equal(a.parameters, b.parameters)


def test_scaling_an_output_and_its_noise_together_changes_nothing() -> None:
    """Outputs are weighed by their noise, not by their unit."""
    case = make_case(9, 2, 2, 0.99)
    factor = np.array([1000.0, 1.0])
    scaled = Case(
        case.regressors * factor[:, None],
        case.measured * factor,
        case.theta,
        case.covariance,
        case.noise * factor,
        0.99,
    )
    for a, b in zip(run_rpem(case), run_rpem(scaled), strict=True):
        np.testing.assert_allclose(a.parameters, b.parameters, rtol=1e-9)
