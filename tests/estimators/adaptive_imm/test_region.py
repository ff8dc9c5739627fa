"""How wide the covariance is shown: against scipy's eigenvalues, and innovations whose long-run variance is known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import eigh

from adaptive_flot.contracts import Status
from adaptive_flot.greybox.model import FloatArray
from estimators.adaptive_imm import AdaptiveImm
from estimators.adaptive_imm.region import LongRun, no_narrower
from tests.estimators.adaptive_imm.test_adaptive_imm import regression
from tests.estimators.gaussian import run_estimator


def covariance(generator: np.random.Generator, q: int) -> FloatArray:
    half = generator.normal(size=(q, q + 1)) * 10.0 ** generator.uniform(-3, 1, size=(q, 1))
    found: FloatArray = half @ half.T
    return found


@settings(deadline=None, max_examples=40)
@given(st.integers(1, 5), st.integers(0, 2**32 - 1), st.floats(0.01, 3.0))
def test_no_direction_is_narrower_than_in_either_and_only_where_needed(q: int, seed: int, share: float) -> None:
    """scipy's generalised eigenvectors X of R and C: X' C X = 1 and X' R X = W, and the result has max(1, share W)."""
    generator = np.random.default_rng(seed)
    C, R = covariance(generator, q), covariance(generator, q)
    found = np.array(no_narrower(q)(C, R, share))
    values, X = eigh(R, C)
    np.testing.assert_allclose(X.T @ found @ X, np.diag(np.maximum(1, share * values)), rtol=1e-6, atol=1e-6)


def test_a_parameter_that_is_known_exactly_has_the_share_of_the_reference() -> None:
    R = np.array([[4.0, 1.0], [1.0, 2.0]])
    np.testing.assert_allclose(np.array(no_narrower(2)(np.zeros((2, 2)), R, 0.25)), R / 4, rtol=1e-6)


def run(innovations: FloatArray, dt: float = 1.0, average_s: float = 30.0, memory_s: float = 600.0) -> FloatArray:
    """The result after each sample (N, m), NaN where an innovation is missing."""
    rule, m = LongRun(dt, average_s, memory_s), innovations.shape[1]
    before, v, present = ca.MX.sym("before", m, LongRun.COLUMNS), ca.MX.sym("v", m), ca.MX.sym("present", m)
    after, _ = rule.expressions(before, v, ca.MX.ones(m), present)
    all_rows = ca.Function("step", [before, v, present], [ca.densify(after)]).mapaccum(len(innovations))
    found = all_rows(LongRun.first(m), np.nan_to_num(innovations).T, np.isfinite(innovations).astype(float).T)
    return np.array(found)[:, 2 :: LongRun.COLUMNS].T


def test_white_innovations_have_a_long_run_variance_of_one() -> None:
    white = np.random.default_rng(1).normal(size=(40000, 2))
    np.testing.assert_allclose(run(white)[2000:].mean(axis=0), 1.0, atol=0.1)


def test_innovations_with_a_memory_have_that_of_an_autoregression() -> None:
    """v_k = r v_(k-1) + e with variance 1 has the long-run variance (1 + r) / (1 - r)."""
    generator, r = np.random.default_rng(2), 0.5
    v = np.zeros(60000)
    for k in range(1, len(v)):
        v[k] = r * v[k - 1] + np.sqrt(1 - r**2) * generator.normal()
    assert run(v[:, None])[2000:].mean() == pytest.approx((1 + r) / (1 - r), rel=0.1)


def test_an_assay_now_and_then_counts_as_one_sample() -> None:
    """One value a minute, white: the gaps are no memory."""
    sparse = np.full((120000, 1), np.nan)
    sparse[::60] = np.random.default_rng(3).normal(size=(2000, 1))
    assert run(sparse)[6000:].mean() == pytest.approx(1.0, abs=0.15)


def test_an_absurd_value_counts_for_what_it_may() -> None:
    """After n = 1000 white samples one of 1e6 adds no more than one of three standard deviations."""
    white = np.random.default_rng(4).normal(size=(1000, 1))
    absurd, bounded = (run(np.vstack([white, [[value]]]))[-1, 0] for value in (1e6, 3.0))
    assert absurd == bounded


@pytest.mark.parametrize("slow", [0.0, 0.3])
def test_the_region_grows_where_innovations_stay_on_one_side(slow: float) -> None:
    """Y = th u + noise of 0.1 + a slow sine: the estimates are the same without this part, and one factor is on all."""
    generator, rows = np.random.default_rng(5), 1500
    inputs = generator.normal(size=rows)
    outputs = inputs + 0.1 * generator.normal(size=rows) + slow * np.sin(np.arange(rows) / 40)
    record = regression(rows, outputs, inputs, 0.1)
    options: dict[str, Any] = {"discrepancies": (), "noise_memory": 0}
    plain = run_estimator(AdaptiveImm(record.setup, long_run_s=0.0, **options), record)
    grown = run_estimator(AdaptiveImm(record.setup, **options), record)
    np.testing.assert_array_equal([e.parameters for e in plain], [e.parameters for e in grown])
    factor = grown[-1].covariance[0, 0] / plain[-1].covariance[0, 0]
    assert 1 <= factor < 1.6 if slow == 0 else factor > 10


def test_a_sample_that_is_no_number_leaves_the_region_as_it_was() -> None:
    """The covariance that is shown, not that of the modes, which is narrower."""
    generator, rows = np.random.default_rng(6), 200
    inputs = generator.normal(size=rows)
    inputs[150] = np.nan
    record = regression(rows, inputs + 0.1 * generator.normal(size=rows), inputs, 0.1)
    found = run_estimator(AdaptiveImm(record.setup), record)
    assert found[150].status is Status.NOT_FINITE
    np.testing.assert_array_equal(found[150].covariance, found[149].covariance)
    np.testing.assert_array_equal(found[150].parameters, found[149].parameters)


@pytest.mark.parametrize("mode", ["rest", "jump"])
def test_what_is_known_exactly_and_never_moves_is_estimated_all_the_same(mode: str) -> None:
    generator, rows = np.random.default_rng(7), 100
    inputs = generator.normal(size=rows)
    record = regression(rows, inputs + 0.1 * generator.normal(size=rows), inputs, 0.1)
    prior = replace(record.prior, covariance=np.zeros((1, 1)))
    options: dict[str, Any] = {"modes": (mode,), "background_per_hour": 0.0, "plausible": 1e-12}
    found = run_estimator(AdaptiveImm(record.setup, **options), replace(record, prior=prior))
    assert Status.NOT_FINITE not in {e.status for e in found}
