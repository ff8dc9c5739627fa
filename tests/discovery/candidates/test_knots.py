"""Knots that a curve does not need: on a linear problem the promise is exact, and what is left draws the profile."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from adaptive_flot.discovery.candidates.catalogue import FINE_TIME_KNOTS, TIME_KNOTS
from adaptive_flot.discovery.candidates.knots import MOST_KNOTS, is_even, trimmed
from adaptive_flot.discovery.candidates.shapes.step_events import freer
from adaptive_flot.discovery.candidates.spline import knots_of, spline_values
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import make_problem
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray
from tests.discovery.heated import heated_tank, tank_record

TIME = np.arange(0.0, 2400.0, 4.0)
GRID = np.linspace(TIME[0], TIME[-1], MOST_KNOTS)
PRICE = float(np.log(len(TIME)))


@pytest.fixture(scope="module")
def any_fit() -> Fit:
    problem = make_problem(tank_record(), heated_tank(), ("efficiency", "loss"), burn_in=30, guard=5)
    fit = Fitter(problem).fit(heated_tank(), rounds=1, steps=1)
    assert fit is not None
    return fit


def _regression(profile: FloatArray, noise: float, seed: int) -> tuple[FloatArray, Effect, FloatArray, FloatArray]:
    """Measurements of a profile, and the least-squares curve through all knots of the grid with its covariance."""
    measured = profile + noise * np.random.default_rng(seed).standard_normal(len(TIME))
    basis = CubicSpline(GRID, np.eye(MOST_KNOTS), bc_type="natural")(TIME)
    covariance: FloatArray = np.array(np.linalg.inv(basis.T @ basis) * noise**2, dtype=float)
    values = covariance @ basis.T @ measured / noise**2
    names = [f"value_{k + 1}" for k in range(MOST_KNOTS)]
    coefficients = dict(zip(names, map(float, values), strict=True))
    effect = Effect("heat_loss", "time", "curve", coefficients, settings={"knots": tuple(map(float, GRID))})
    return measured, effect, values, covariance


def _fit_of(like: Fit, effect: Effect, values: FloatArray, covariance: FloatArray) -> Fit:
    names = tuple(effect.parameter(f"value_{k + 1}") for k in range(MOST_KNOTS))
    return replace(like, names=names, values=values, covariance=covariance)


def _loss(measured: FloatArray, knots: FloatArray, noise: float) -> float:
    basis = CubicSpline(knots, np.eye(len(knots)), bc_type="natural")(TIME)
    left = measured - basis @ np.linalg.lstsq(basis, measured, rcond=None)[0]
    return float(left @ left / noise**2)


def _dose(onset: float, decay: float) -> FloatArray:
    since = np.maximum(TIME - onset, 0.0)
    found: FloatArray = (1 - np.exp(-since / 60.0)) * np.exp(-since / decay)
    return found


@settings(max_examples=20, deadline=None)
@given(onset=st.floats(200.0, 2000.0), decay=st.floats(100.0, 3000.0), seed=st.integers(0, 99))
def test_what_is_promised_is_what_least_squares_gives(any_fit: Fit, onset: float, decay: float, seed: int) -> None:
    measured, effect, values, covariance = _regression(_dose(onset, decay), 0.05, seed)
    less = trimmed(_fit_of(any_fit, effect, values, covariance), effect, PRICE)
    assert less is not None
    knots = np.array(knots_of(less.variant.effect))
    spared = MOST_KNOTS - len(knots)
    exact = _loss(measured, GRID, 0.05) + PRICE * spared - _loss(measured, knots, 0.05)
    assert less.gain == pytest.approx(exact, abs=1e-6) and less.gain > 0
    assert knots[0] == GRID[0] and knots[-1] == GRID[-1] and is_even(list(knots))
    # the start values are those of the least-squares curve through the knots that are left
    basis = CubicSpline(knots, np.eye(len(knots)), bc_type="natural")(TIME)
    best = np.linalg.lstsq(basis, measured, rcond=None)[0]
    np.testing.assert_allclose(list(less.start.values()), best, atol=1e-6)


def test_a_straight_line_needs_its_ends(any_fit: Fit) -> None:
    _, effect, _, covariance = _regression(TIME / 2400.0, 0.05, 1)
    less = trimmed(_fit_of(any_fit, effect, GRID / 2400.0, covariance), effect, PRICE)
    assert less is not None and len(less.start) == 2


def test_a_curve_that_needs_all_its_knots_keeps_them(any_fit: Fit) -> None:
    zigzag = spline_values(TIME, list(GRID)) @ ((-1.0) ** np.arange(MOST_KNOTS))
    _, effect, values, covariance = _regression(zigzag, 1e-3, 1)
    assert trimmed(_fit_of(any_fit, effect, values, covariance), effect, PRICE) is None


def test_a_form_without_knots_has_none_to_spare(any_fit: Fit) -> None:
    step = Effect("heat_loss", "time", "step", {"amplitude": 0.3, "onset": 800.0})
    assert trimmed(any_fit, step, PRICE) is None


def test_knots_around_an_event_are_not_even() -> None:
    """On that rests whether a change of an adapted parameter is a drift."""
    event = Effect("coalescence", "time", "washout", {"amplitude": 0.4, "onset": 1000.0, "time_constant": 100.0})
    found = freer(event, 0.0, 3000.0)
    assert found is not None
    assert not is_even(knots_of(found[0].effect))
    assert is_even(list(np.linspace(0.0, 3000.0, 5)))
    for count in (TIME_KNOTS, FINE_TIME_KNOTS, MOST_KNOTS):  # what trimming leaves of the curves a search draws
        grid = np.linspace(30.0, 3000.0, count)
        assert is_even([grid[k] for k in (0, 1, count - 1)])
