"""Most likely drift: found where parameters walk, none where they rest, and nothing claimed that the record allows."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.contracts import Prior, Sample, Setup
from adaptive_flot.greybox.model import FloatArray
from estimators.ekf.likely_drift import SLOWEST, log_likelihood, most_likely_drift
from tests.estimators import toys
from tests.estimators.gaussian import affine_maps, linear_record


def regression(theta: FloatArray, noise: float) -> tuple[Setup, Prior, list[Sample]]:
    """y = theta' u with the path of theta (N, 2) around 1."""
    generator = np.random.default_rng(7)
    model = toys.linear(2, value=1.0)
    setup = Setup(model, 1.0, model.names("parameters"), model.names("outputs"))
    inputs = generator.normal(size=theta.shape)
    outputs = (inputs * theta).sum(axis=1) + noise * generator.normal(size=len(theta))
    samples = [Sample(k + 1.0, u, np.array([y])) for k, (u, y) in enumerate(zip(inputs, outputs, strict=True))]
    return setup, Prior(0.0, np.zeros(1), np.ones(2), np.eye(2), np.array([noise])), samples


def test_likelihood_is_that_of_the_joint_gaussian_of_all_measurements() -> None:
    """Computed at once from the covariance of the record, without any filter."""
    record = linear_record(2, rows=12)
    setup, Q = record.setup, np.zeros(4)
    Q[2:] = (0.9 * np.array([1.0, 0.5])) ** 2 / 3600.0
    steps, measurements = affine_maps(record)
    assert record.prior.joint_covariance is not None
    count = 4 + 2 * len(record.samples)
    to_z = np.zeros((4, count + 1))
    to_z[:, :4] = np.linalg.cholesky(record.prior.joint_covariance)
    to_z[:, -1] = np.concatenate([record.prior.state, record.prior.parameters])
    rows, right, noise = [], [], []
    for k, sample in enumerate(record.samples):
        started = to_z.copy()
        started[[2, 3], [4 + 2 * k, 5 + 2 * k]] += np.sqrt(Q[2:])
        for j in np.flatnonzero(np.isfinite(sample.outputs)):
            row = measurements[k][j, :-1] @ started
            rows.append(row[:-1])
            right.append(sample.outputs[j] - row[-1] - measurements[k][j, -1])
            noise.append(record.prior.noise_std[j])
        to_z = steps[k][:, :-1] @ started
        to_z[:, -1] += steps[k][:, -1]
    A, b = np.array(rows), np.array(right)
    S = A @ A.T + np.diag(np.array(noise) ** 2)
    expected = -0.5 * (b @ np.linalg.solve(S, b) + np.linalg.slogdet(2 * np.pi * S)[1])
    assert log_likelihood(setup, record.prior, record.samples, 0.9) == pytest.approx(expected, rel=1e-9)


def test_a_walk_is_found() -> None:
    moves = 0.6 / 60.0 * np.random.default_rng(1).normal(size=(1500, 2))
    estimates = most_likely_drift(*regression(1.0 + np.cumsum(moves, axis=0), noise=0.05))
    assert estimates.drift_per_hour == pytest.approx(0.6, rel=0.25)
    assert estimates.drift_per_hour < estimates.upper < 1.2


def test_parameters_at_rest_have_no_drift_but_a_short_record_allows_some() -> None:
    estimates = most_likely_drift(*regression(np.ones((400, 2)), noise=0.05))
    assert estimates.drift_per_hour < 0.1
    assert estimates.upper > max(estimates.drift_per_hour, 10 * SLOWEST)
