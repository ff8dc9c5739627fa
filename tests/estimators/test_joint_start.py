"""Where the joint filters start: the batch fit's covariance of state and parameters together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.record import RecordSimulator
from adaptive_flot.protocols import Setup
from estimators.coordinates import Coordinates
from estimators.ekf import Ekf
from estimators.pem import Pem
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
    found = replay(Ekf(cell_case.setup, drift_per_hour=0.3), cell_case.prior, cell_case.samples)
    truth = cell_case.prior.parameters * 1.05
    std = np.sqrt(np.diag(found[-1].covariance))
    assert np.all(np.abs(found[-1].parameters - truth) < 3 * std)
    assert np.abs(found[-1].innovation[0]) < 5 * found[-1].innovation_std[0]
