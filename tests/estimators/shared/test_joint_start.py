"""Where the joint filters start: the batch fit's covariance of state and parameters together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.contracts import Setup, Status
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.record import RecordSimulator
from adaptive_flot.plugins import ESTIMATORS, load
from estimators.ekf import Ekf
from estimators.pem import Pem
from estimators.shared.coordinates import Coordinates
from estimators.shared.joint_filter import first_estimate, layout
from tests.estimators import toys
from tests.estimators.conftest import CellCase, replay


@pytest.mark.parametrize("start", ["steady", "given"])
def test_joint_covariance_is_what_the_parameters_leave_open_in_the_last_state(start: str) -> None:
    """Central differences of the last state, weighted with the covariance of the fit; the start moves too."""
    generator = np.random.default_rng(3)
    model = toys.decay()
    u = np.concatenate([np.ones(20), generator.normal(size=40)])
    data = toys.record(model, u, x0=(2.5,), noise=0.05 * generator.standard_normal((60, 1)), given=start == "given")
    setup = Setup(model, 1.0, ("a", "b"), ("y",))
    fit = Pem(setup, initial_state=start).fit(data)  # type: ignore[arg-type]
    joint = fit.joint_covariance
    assert joint is not None and joint.shape == (3, 3)
    np.testing.assert_allclose(joint[1:, 1:], fit.covariance, rtol=1e-9)
    simulator = RecordSimulator(model, 1.0)

    def last(values: FloatArray) -> float:
        x0 = np.array([values[1] / values[0] * u[0]]) if start == "steady" else data.initial_state
        assert x0 is not None
        return float(simulator.last_state(data, x0, values)[0])

    slope = np.array([(last(fit.values() + h) - last(fit.values() - h)) / 2e-6 for h in 1e-6 * np.eye(2)])
    np.testing.assert_allclose(joint[0, 1:], slope @ fit.covariance, rtol=1e-5)
    np.testing.assert_allclose(joint[0, 0], slope @ fit.covariance @ slope, rtol=1e-5)


def test_an_unknown_initial_state_adds_to_the_uncertainty_of_the_last_one() -> None:
    """Four samples after the start the state is not yet a function of the parameters."""
    model = toys.decay()
    data = toys.record(model, [1.0, 1.0, -1.0, 0.5, 2.0], x0=(2.5,), noise=np.array([[0.1], [-0.1], [0], [0.1], [0]]))
    joint = Pem(Setup(model, 1.0, ("a", "b"), ("y",)), initial_state="estimated").fit(data).joint_covariance
    assert joint is not None
    explained = joint[0, 1:] @ np.linalg.solve(joint[1:, 1:], joint[1:, 0])
    assert joint[0, 0] > 1.01 * explained


def test_coordinates_of_the_cell_are_n_and_log_c(cell_case: CellCase) -> None:
    """A coefficient with a dimension is estimated by its logarithm, an exponent as it is; also on the bounds."""
    coordinates = Coordinates.of(cell_case.setup.model, cell_case.setup.parameters)
    assert coordinates.log == (False, True)
    for theta in (np.array([1.0, 6.38e-4]), coordinates.range[:, 0], coordinates.range[:, 1]):
        c = coordinates.from_parameters(theta)
        np.testing.assert_allclose(coordinates.to_parameters(c), theta, rtol=1e-14)
        assert (coordinates.range[:, 0] <= coordinates.to_parameters(c)).all()
        assert (coordinates.to_parameters(c) <= coordinates.range[:, 1]).all()
    h = 1e-6
    c = coordinates.from_parameters(np.array([1.1, 5e-4]))
    rise = coordinates.to_parameters(c + h) - coordinates.to_parameters(c - h)
    np.testing.assert_allclose(coordinates.slopes(c), rise / (2 * h), rtol=1e-8)


def test_an_absurd_value_moves_the_estimate_by_a_few_standard_deviations_only(cell_case: CellCase) -> None:
    """One sample of 1e6; ten samples later the estimates are those of the record without it, within one std."""
    samples = list(cell_case.samples)
    samples[20] = replace(samples[20], outputs=np.where(np.isnan(samples[20].outputs), np.nan, 1e6))
    estimator = Ekf(cell_case.setup)
    clean = replay(estimator, cell_case.prior, cell_case.samples)
    struck = replay(estimator, cell_case.prior, tuple(samples))
    for k, limit in ((20, 10.0), (40, 1.0)):
        std = np.sqrt(np.diag(clean[k].covariance))
        assert np.all(np.abs(struck[k].parameters - clean[k].parameters) <= limit * std)
    unprotected = replay(Ekf(cell_case.setup, outlier_std=np.inf), cell_case.prior, tuple(samples))
    assert np.any(np.abs(unprotected[20].parameters - clean[20].parameters) > 100 * std)


def test_estimates_of_the_cell_lie_within_their_uncertainty(cell_case: CellCase) -> None:
    """n and C rise by 5 % a minute; the drift given is about that of the record, the truth lies within 3 std."""
    tracked = replay(Ekf(cell_case.setup, drift_per_hour=0.3), cell_case.prior, cell_case.samples)
    truth = cell_case.prior.parameters * 1.05
    std = np.sqrt(np.diag(tracked[-1].covariance))
    assert np.all(np.abs(tracked[-1].parameters - truth) < 3 * std)
    assert np.abs(tracked[-1].innovation[0]) < 5 * tracked[-1].innovation_std[0]


@pytest.mark.parametrize("seed", range(4))
def test_a_direction_that_is_open_beyond_its_range_is_measured_once(cell_case: CellCase, seed: int) -> None:
    """To the variance of that range, against the Kalman update; a prior that is known better stays as it is."""
    setup = cell_case.setup
    coordinates, shape = Coordinates.of(setup.model, setup.parameters), layout(setup)
    theta, n = cell_case.prior.parameters, shape.size
    to_prior = np.diag([*np.ones(shape.nx), *coordinates.slopes(coordinates.from_parameters(theta))])
    widest = (coordinates.upper - coordinates.lower) / np.sqrt(12.0)
    half = np.random.default_rng(seed).normal(size=(n, n))
    half[shape.coordinates] *= widest[:, None]
    joint = half @ half.T
    largest, _ = _eigen(joint[shape.nx :, shape.nx :], widest)

    def start(covariance: FloatArray) -> FloatArray:
        prior = replace(cell_case.prior, joint_covariance=to_prior @ covariance @ to_prior)
        return first_estimate(prior, coordinates, shape)[1]

    known, wide = 0.99 / largest.max() * joint, 30.0 / largest.max() * joint
    np.testing.assert_allclose(start(known), known, rtol=1e-13)
    expected = wide
    for size, direction in zip(*_eigen(wide[shape.nx :, shape.nx :], widest), strict=True):
        if size > 1.0:
            row = np.concatenate([np.zeros(shape.nx), direction / widest])
            gain = expected @ row / (row @ expected @ row + size / (size - 1.0))
            expected = expected - np.outer(gain, row @ expected)
    np.testing.assert_allclose(start(wide), expected, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(_eigen(start(wide)[shape.nx :, shape.nx :], widest)[0].max(), 1.0, rtol=1e-9)


def _eigen(covariance: FloatArray, scale: FloatArray) -> tuple[FloatArray, FloatArray]:
    sizes, directions = np.linalg.eigh(covariance / np.outer(scale, scale))
    return sizes, directions.T


@pytest.mark.parametrize("name", ["ekf", "imm", "mhe"])
def test_a_first_record_that_said_nothing_along_the_ridge_is_no_end(cell_case: CellCase, name: str) -> None:
    """Inputs at rest leave n and C open by any factor in a batch fit: the filters go on, and the grade is predicted."""
    theta = cell_case.prior.parameters
    ridge = theta * np.array([0.25, -1.0])
    open_ = cell_case.prior.covariance + 1e14 * np.outer(ridge, ridge)
    options = {"window_s": 12, "solve_every_s": 4} if name == "mhe" else {}
    estimator = load(name, ESTIMATORS, "estimator")(cell_case.setup, **options)
    tracked = replay(estimator, replace(cell_case.prior, covariance=open_), cell_case.samples)
    for e in tracked:
        assert np.isfinite(e.parameters).all() and np.isfinite(e.covariance).all() and np.isfinite(e.state).all()
        assert e.status in (Status.OK, Status.PROJECTED)
    grade = cell_case.setup.model.index("outputs", "concentrate_grade")
    assert np.abs([e.innovation[grade] for e in tracked[-20:]]).mean() < 3e-3
