"""The joint filter of a linear model is the Kalman filter: exactly the conditional mean and covariance."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.contracts import Status
from estimators.ekf import Ekf
from estimators.shared.coordinates import Coordinates
from estimators.shared.joint_filter import HOUR, layout, process_noise
from tests.estimators.gaussian import affine_maps, first_rows, linear_record, posterior, run_estimator


@pytest.mark.parametrize(("walk", "state_noise"), [("random", 0.0), ("random", 0.3), ("integrated", 0.2)])
def test_estimates_are_conditional_means_and_covariances(walk: str, state_noise: float) -> None:
    """Against one least-squares problem over the record so far, with missing samples and two rates of measurement."""
    record = linear_record(1)
    integrated = walk == "integrated"
    estimator = Ekf(
        record.setup,
        drift_per_hour={"th0": 3.0, "th1": 6.0},
        walk=walk,  # type: ignore[arg-type]
        state_noise=state_noise,
        outlier_std=np.inf,
    )
    estimates = run_estimator(estimator, record)
    for count in (1, 6, 9, 16, 25):
        means, covariances = posterior(first_rows(record, count), estimator.noise, integrated=integrated)
        e = estimates[count - 1]
        np.testing.assert_allclose(np.concatenate([e.state, e.parameters]), means[-1][:4], rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(e.covariance, covariances[-1][2:4, 2:4], rtol=1e-8, atol=1e-10)
    assert [e.status for e in estimates[6:11]] == [Status.OK, *[Status.MISSING] * 3, Status.OK]


def test_predictions_and_their_std_are_those_of_the_next_sample_given_the_past() -> None:
    record = linear_record(2)
    estimator = Ekf(record.setup, drift_per_hour=4.0, state_noise=0.1, outlier_std=np.inf)
    estimates = run_estimator(estimator, record)
    means, covariances = posterior(first_rows(record, 12), estimator.noise)
    H = affine_maps(record)[1][12]
    np.testing.assert_allclose(estimates[12].prediction, H[:, :-1] @ means[-1] + H[:, -1], rtol=1e-8)
    spread = H[:, :-1] @ (covariances[-1] + estimator.noise) @ H[:, :-1].T
    np.testing.assert_allclose(
        estimates[12].innovation_std, np.sqrt(np.diag(spread) + record.prior.noise_std**2), rtol=1e-8
    )


def test_drift_is_the_std_of_the_parameters_after_an_hour() -> None:
    """Both walks, without a measurement, and with another sampling interval: an option in physical units."""
    record = linear_record(3)
    shape, coordinates = layout(record.setup), Coordinates.of(record.setup.model, record.setup.parameters)
    Q = process_noise(record.setup, coordinates, shape, np.array([0.1, 0.2]), 0.0)
    np.testing.assert_allclose(np.sqrt(HOUR * np.diag(Q)[2:]), [0.1 * 1.0, 0.2 * 0.5])
    shape = layout(record.setup, integrated=True)
    Q = process_noise(record.setup, coordinates, shape, np.array([0.1, 0.2]), 0.0)
    covariance = np.zeros((2, 2))
    F = np.array([[1.0, record.setup.dt], [0.0, 1.0]])
    for _ in range(int(HOUR)):
        covariance = F @ (covariance + np.diag([0.0, Q[4, 4]])) @ F.T
    np.testing.assert_allclose(np.sqrt(covariance[0, 0]), 0.1, rtol=1e-3)
