"""The whiteness test of the innovations against its formula and its distribution."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.diagnostic import acorr_ljungbox

from adaptive_flot.runner.results.whiteness import ljung_box_p


def test_it_is_the_formula_of_ljung_and_box() -> None:
    """Q = N (N + 2) sum r_k^2 / (N - k) over 20 lags, chi-squared with 20 degrees of freedom, as in statsmodels."""
    e = np.random.default_rng(0).normal(size=300)
    e[1:] += 0.1 * e[:-1]
    centred = e - e.mean()
    r = np.array([centred[k:] @ centred[: 300 - k] for k in range(21)]) / (centred @ centred)
    q = 300 * 302 * np.sum(r[1:] ** 2 / (300 - np.arange(1, 21)))
    assert ljung_box_p(e) == pytest.approx(stats.chi2.sf(q, 20), rel=1e-9)
    assert ljung_box_p(e) == pytest.approx(float(acorr_ljungbox(e, lags=[20])["lb_pvalue"].iloc[0]), rel=1e-9)


def test_white_innovations_give_uniform_p_values() -> None:
    generator = np.random.default_rng(1)
    p = [ljung_box_p(generator.normal(size=400)) for _ in range(200)]
    assert stats.kstest(p, "uniform").pvalue > 0.01
    assert 0.01 < np.mean(np.array(p) < 0.05) < 0.11


def test_coloured_innovations_give_tiny_ones() -> None:
    e = np.random.default_rng(2).normal(size=400)
    for k in range(1, 400):
        e[k] += 0.5 * e[k - 1]
    assert ljung_box_p(e) < 1e-9


def test_holes_in_a_white_series_leave_it_white() -> None:
    generator = np.random.default_rng(3)
    p = []
    for _ in range(100):
        e = generator.normal(size=300)
        e[generator.integers(0, 300, 100)] = np.nan
        p.append(ljung_box_p(e))
    assert np.isfinite(p).all() and stats.kstest(p, "uniform").pvalue > 0.01


@pytest.mark.parametrize("series", [np.zeros(100), np.full(100, np.nan), np.arange(40.0), np.array([])])
def test_too_short_or_constant_a_series_has_no_p_value(series: np.ndarray[tuple[int], np.dtype[np.float64]]) -> None:
    assert np.isnan(ljung_box_p(series))
