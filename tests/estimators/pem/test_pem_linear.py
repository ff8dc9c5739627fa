"""The batch fit of a model that is linear in its parameters is ordinary (weighted, Bayesian) least squares."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.contracts import Setup, Status
from adaptive_flot.contracts.batch import BatchFit
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from estimators.pem import Pem
from tests.estimators import toys

TRUTH = np.array([0.7, -1.3, 2.1])


def make_record(seed: int, q: int, m: int = 1, rows: int = 80, noise: tuple[float, ...] = (0.3,)) -> Dataset:
    generator = np.random.default_rng(seed)
    model = toys.linear(q, m)
    truth = {f"th{i}": float(v) for i, v in enumerate(TRUTH[:q])}
    errors = np.array(noise) * generator.normal(size=(rows, m))
    return toys.record(model, generator.normal(size=(rows, m * q)), parameters=truth, noise=errors)


def fit(model: Model, record: Dataset, **options: Any) -> BatchFit:
    return Pem(Setup(model, 1.0, model.names("parameters"), model.names("outputs")), **options).fit(record)


def ordinary(X: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Estimates (q,), covariance (q, q) and residual standard deviation, from the textbook."""
    theta: FloatArray = np.asarray(np.linalg.lstsq(X, y)[0], dtype=float)
    variance = float(np.sum((y - X @ theta) ** 2)) / (len(y) - X.shape[1])
    covariance: FloatArray = np.asarray(variance * np.linalg.inv(X.T @ X), dtype=float)
    return theta, covariance, float(np.sqrt(variance))


@pytest.mark.parametrize("options", [{"initial_state": "given"}, {"initial_state": "steady"}, {"free": ()}], ids=str)
@pytest.mark.parametrize("q", [1, 3])
def test_estimates_covariance_and_noise_are_those_of_lstsq(q: int, options: dict[str, Any]) -> None:
    if "free" in options:
        options = {"initial_state": "estimated", **options}
    record = make_record(1, q)
    result = fit(toys.linear(q), record, **options)
    theta, covariance, noise = ordinary(record.inputs, record.outputs[:, 0])
    np.testing.assert_allclose(result.values(), theta, rtol=1e-8)
    np.testing.assert_allclose(result.covariance, covariance, rtol=1e-6)
    np.testing.assert_allclose(result.noise_std, noise, rtol=1e-8)
    np.testing.assert_allclose([e.std for e in result.estimates], np.sqrt(np.diag(covariance)), rtol=1e-6)
    assert result.status is Status.OK


@given(seed=st.integers(0, 10**6), q=st.integers(1, 3), rows=st.integers(12, 60))
def test_any_record_gives_the_estimates_of_lstsq(seed: int, q: int, rows: int) -> None:
    """The covariance is scaled with a noise level that may be 1 % (its stopping rule) from the last one."""
    record = make_record(seed, q, rows=rows)
    result = fit(toys.linear(q), record, initial_state="given")
    theta, covariance, noise = ordinary(record.inputs, record.outputs[:, 0])
    np.testing.assert_allclose(result.values(), theta, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(result.noise_std, noise, rtol=1e-7)
    np.testing.assert_allclose(result.covariance, covariance, rtol=0.021, atol=1e-3 * covariance.max())


def test_missing_measurements_drop_out() -> None:
    """The fit with holes is the fit of the rows that are left."""
    record = make_record(2, 3)
    holes = np.zeros(len(record), dtype=bool)
    holes[[0, 3, 4, 5, 40, 79]] = True
    result = fit(toys.linear(3), toys.measured_as(record, np.where(holes[:, None], np.nan, record.outputs)))
    theta, covariance, noise = ordinary(record.inputs[~holes], record.outputs[~holes, 0])
    np.testing.assert_allclose(result.values(), theta, rtol=1e-8)
    np.testing.assert_allclose(result.covariance, covariance, rtol=1e-6)
    np.testing.assert_allclose(result.noise_std, noise, rtol=1e-8)


def test_two_outputs_are_weighed_by_the_noise_that_each_of_them_leaves() -> None:
    """Iterated weighted least squares, computed with numpy; the second output is a hundred times noisier."""
    record = make_record(3, 2, m=2, rows=120, noise=(0.02, 2.0))
    result = fit(toys.linear(2, 2), record, initial_state="given")
    X = record.inputs.reshape(-1, 2, 2)
    sigma = np.ones(2)
    for _ in range(30):
        rows, right = (X / sigma[:, None]).reshape(-1, 2), (record.outputs / sigma).ravel()
        theta = np.linalg.lstsq(rows, right)[0]
        sigma = np.sqrt(np.mean((record.outputs - X @ theta) ** 2, axis=0))
    dof = np.sqrt(240 / 238)
    std = dof * np.sqrt(np.diag(np.linalg.inv(rows.T @ rows)))
    np.testing.assert_allclose(result.values(), theta, atol=float(0.01 * std.min()))
    np.testing.assert_allclose([e.std for e in result.estimates], std, rtol=0.02)
    np.testing.assert_allclose(result.noise_std, dof * sigma, rtol=1e-3)


@pytest.mark.parametrize("prior_std", [1e-3, 0.05, 10.0])
def test_prior_std_pulls_as_the_bayesian_formula_says(prior_std: float) -> None:
    """theta = (X'X / s^2 + D^-2)^-1 (X'y / s^2 + D^-2 theta_0): from the prior alone to the data alone."""
    model, generator = toys.linear(2, value=0.5, prior_std=prior_std), np.random.default_rng(4)
    truth, noise = {"th0": 0.6, "th1": 0.4}, 0.3 * generator.normal(size=(50, 1))
    record = toys.record(model, generator.normal(size=(50, 2)), parameters=truth, noise=noise)
    result = fit(model, record, initial_state="given")
    X, y = record.inputs, record.outputs[:, 0]
    sigma = 0.3
    for _ in range(30):
        information = X.T @ X / sigma**2 + np.eye(2) / prior_std**2
        theta = np.linalg.solve(information, X.T @ y / sigma**2 + 0.5 / prior_std**2)
        sigma = float(np.sqrt(np.sum((y - X @ theta) ** 2) / (len(y) - 2)))
    np.testing.assert_allclose(result.values(), theta, atol=0.02 * np.sqrt(np.linalg.inv(information).max()))
    np.testing.assert_allclose(result.covariance, np.linalg.inv(information), rtol=0.06, atol=1e-3 * prior_std**2)


def test_where_the_record_says_nothing_the_prior_is_the_answer() -> None:
    """The second regressor is zero throughout: its parameter keeps its value and its prior standard deviation."""
    model = toys.linear(2, value=0.5, prior_std=0.2)
    generator = np.random.default_rng(5)
    inputs = np.column_stack([generator.normal(size=12), np.zeros(12)])
    record = toys.record(model, inputs, parameters={"th0": 1.0}, noise=0.1 * generator.normal(size=(12, 1)))
    result = fit(model, record, initial_state="given")
    assert result.estimates[1].value == pytest.approx(0.5)
    assert result.estimates[1].std == pytest.approx(0.2, rel=0.01)


def test_the_fit_does_not_depend_on_the_scale_of_the_unknowns() -> None:
    """Scales condition the solver; they are no prior."""
    record = make_record(6, 2)
    plain, scaled = (fit(toys.linear(2, scale=s), record, initial_state="given") for s in (1.0, 1e-3))
    np.testing.assert_allclose(plain.values(), scaled.values(), rtol=1e-7)
    np.testing.assert_allclose(plain.covariance, scaled.covariance, rtol=1e-5)


def test_the_next_prior_is_the_fit(model: Model) -> None:
    """What a recursive estimator goes on from: last state, values, covariance and noise level of the fit."""
    del model
    result = fit(toys.linear(2), make_record(7, 2), initial_state="given")
    prior = result.prior(79.0)
    assert prior.time == 79.0
    np.testing.assert_array_equal(prior.parameters, [e.value for e in result.estimates])
    np.testing.assert_array_equal(prior.covariance, result.covariance)
    np.testing.assert_array_equal(prior.noise_std, result.noise_std)
    np.testing.assert_array_equal(prior.state, result.last_state)


def test_the_order_of_the_parameters_is_that_of_the_setup() -> None:
    record = make_record(8, 3)
    model = toys.linear(3)
    there = Pem(Setup(model, 1.0, ("th0", "th1", "th2"), ("y0",)), initial_state="given").fit(record)
    back = Pem(Setup(model, 1.0, ("th2", "th0", "th1"), ("y0",)), initial_state="given").fit(record)
    np.testing.assert_allclose(back.values(), there.values()[[2, 0, 1]], rtol=1e-8)
    np.testing.assert_allclose(back.covariance, there.covariance[np.ix_([2, 0, 1], [2, 0, 1])], rtol=1e-6)
    np.testing.assert_allclose(back.parameters, there.parameters, rtol=1e-8)


def test_parameters_that_are_not_fitted_stay() -> None:
    model = toys.linear(2, value=0.5)
    record = make_record(9, 2)
    result = Pem(Setup(model, 1.0, ("th1",), ("y0",)), initial_state="given").fit(replace(record))
    theta, _, _ = ordinary(record.inputs[:, 1:], record.outputs[:, 0] - 0.5 * record.inputs[:, 0])
    np.testing.assert_allclose(result.parameters, [0.5, theta[0]], rtol=1e-8)
