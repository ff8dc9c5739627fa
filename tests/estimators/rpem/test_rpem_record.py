"""RPEM over a whole record gives the estimates of RPEM sample by sample, whatever the record holds."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup, Status
from adaptive_flot.contracts.track import Track
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.stepper import Stepper
from estimators.rpem.estimator import Rpem
from estimators.rpem.record import BLOCK_ROWS
from tests.estimators.toys import decay, square

ROWS = 2 * BLOCK_ROWS + 37  # whole blocks and a rest
PRIOR = Prior(0.0, np.zeros(1), np.array([0.5, 1.2]), np.diag([0.04, 0.04]), np.array([0.02]))


def record() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time, inputs and outputs; now and then a measurement is missing, and once it is absurd."""
    rng = np.random.default_rng(5)
    u = np.repeat(rng.uniform(-1, 1, ROWS // 5 + 1), 5)[:ROWS, None]
    y: FloatArray = Stepper(decay(), 0.5).simulate(np.zeros(1), u).outputs + 0.02 * rng.standard_normal((ROWS, 1))
    y[rng.random(ROWS) < 0.1] = np.nan
    y[BLOCK_ROWS + 3] = -50.0
    return instants(0.5), u, y


def instants(dt: float) -> FloatArray:
    return np.linspace(dt, ROWS * dt, ROWS)


def by_samples(estimator: Rpem, prior: Prior, time: FloatArray, u: FloatArray, y: FloatArray) -> Track:
    state, estimates = estimator.init(prior), list[Estimate]()
    for row in zip(time, u, y, strict=True):
        state, estimate = estimator.update(state, Sample(float(row[0]), row[1], row[2]))
        estimates.append(estimate)
    return Track.of(estimates)


def same(tracked: Track, expected: Track) -> None:
    assert tracked.statuses == expected.statuses
    for name in ("time", "prediction", "innovation_std", "parameters", "covariance", "state"):
        np.testing.assert_allclose(getattr(tracked, name), getattr(expected, name), rtol=1e-9, atol=1e-14, err_msg=name)


@pytest.mark.parametrize(
    "options",
    [{}, {"gradient": "recursive", "forget_to": 0.1}, {"forget_to": 0.1, "freeze_s": 20.0}],
    ids=["printed", "recursive", "freezing"],
)
def test_track_is_update_sample_by_sample(options: dict[str, Any]) -> None:
    """Missing measurements, and an absurd one that puts the estimate on its bounds."""
    estimator = Rpem(Setup(decay(), 0.5, ("a", "b"), ("y",)), forgetting=0.98, **options)
    tracked = estimator.track(estimator.init(PRIOR), *record())
    same(tracked, by_samples(estimator, PRIOR, *record()))
    counts = Counter(tracked.statuses)
    assert counts[Status.MISSING] > 20 and counts[Status.OK] > 100


def test_a_block_with_a_sample_to_skip_is_taken_sample_by_sample() -> None:
    """Where the model has no state the estimate is kept, and after that the record goes on."""
    prior = Prior(0.0, np.ones(1), np.ones(1), np.array([[0.01]]), np.array([0.1]))
    rng = np.random.default_rng(6)
    u = 0.1 * rng.standard_normal((ROWS, 1))
    u[BLOCK_ROWS + 20] = -1e200
    y = 1.0 + 0.1 * rng.standard_normal((ROWS, 1))
    estimator = Rpem(Setup(square(), 0.1, ("p",), ("y",)))
    time = instants(0.1)
    tracked = estimator.track(estimator.init(prior), time, u, y)
    same(tracked, by_samples(estimator, prior, time, u, y))
    assert [k for k, s in enumerate(tracked.statuses) if s is Status.NOT_FINITE] == [BLOCK_ROWS + 20]


def test_the_end_of_a_track_is_where_an_estimator_goes_on() -> None:
    time, u, y = record()
    estimator = Rpem(Setup(decay(), 0.5, ("a", "b"), ("y",)))
    whole = estimator.track(estimator.init(PRIOR), time, u, y)
    first = estimator.track(estimator.init(PRIOR), time[:250], u[:250], y[:250])
    rest = estimator.track(estimator.init(first.end(PRIOR.noise_std)), time[250:], u[250:], y[250:])
    same(Track.joined([first, rest]), whole)
