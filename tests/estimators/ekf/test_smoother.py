"""Smoothing on a linear model is the conditional mean given the whole record; on the cell it knows the past better."""

from __future__ import annotations

import numpy as np
import pytest

from estimators.ekf import Ekf
from estimators.ekf.smoother import smooth
from tests.estimators.conftest import CellCase, replay
from tests.estimators.gaussian import linear_record, posterior


@pytest.mark.parametrize(("walk", "state_noise"), [("random", 0.0), ("random", 0.3), ("integrated", 0.2)])
def test_smoothed_estimates_are_conditional_means_given_the_whole_record(walk: str, state_noise: float) -> None:
    """At every instant, against one least-squares problem; with missing samples and two rates of measurement."""
    record = linear_record(1)
    drift = {"th0": 3.0, "th1": 6.0}
    ekf = Ekf(record.setup, drift_per_hour=drift, walk=walk, state_noise=state_noise, outlier_std=np.inf)  # type: ignore[arg-type]
    estimates = smooth(ekf, record.prior, record.samples)
    means, covariances = posterior(record, ekf.noise, integrated=walk == "integrated")
    np.testing.assert_allclose(estimates.states, means[1:, :2], rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(estimates.parameters, means[1:, 2:4], rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(estimates.covariance, covariances[1:, 2:4, 2:4], rtol=1e-7, atol=1e-9)


def test_without_any_sample_there_is_nothing_to_smooth() -> None:
    record = linear_record(1)
    estimates = smooth(Ekf(record.setup), record.prior, ())
    assert estimates.parameters.shape == (0, 2) and estimates.covariance.shape == (0, 2, 2)


def test_on_the_cell_the_past_is_known_better_than_when_it_was_new(cell_case: CellCase) -> None:
    """The last estimate is the filter's; before it no variance is larger, though the state starts exactly known."""
    ekf = Ekf(cell_case.setup, drift_per_hour=0.05)
    filtered = replay(ekf, cell_case.prior, cell_case.samples)
    estimates = smooth(ekf, cell_case.prior, cell_case.samples)
    np.testing.assert_allclose(estimates.parameters[-1], filtered[-1].parameters, rtol=1e-10)
    variances = np.array([np.diag(e.covariance) for e in filtered])
    smoothed = np.diagonal(estimates.covariance, axis1=1, axis2=2)
    # each in the unit of its own estimate, to first order: hence the margin
    assert (smoothed <= variances * 1.1).all() and (smoothed[20] < 0.95 * variances[20]).any()
    assert (np.linalg.eigvalsh(estimates.covariance) >= -1e-18).all()
