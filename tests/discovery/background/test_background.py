"""A room whose temperature wanders beside a tank: told as that, and the effect beside it by its name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import multivariate_normal

from adaptive_flot.discovery.background.evidence import STDS, Spread, drops, gains_beside
from adaptive_flot.discovery.background.fitting import background_of, fit_with_background
from adaptive_flot.discovery.background.renewed import renewed
from adaptive_flot.discovery.background.spread import spread_of
from adaptive_flot.discovery.background.wording import background_words
from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.background import (
    Background,
    Course,
    knots_of_course,
    lines_between,
    root_of_covariance,
)
from adaptive_flot.discovery.record.problem import Problem, make_problem
from adaptive_flot.discovery.record.robust import without_spikes
from adaptive_flot.discovery.search.rounds import scorer_of
from adaptive_flot.discovery.search.search import search
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model, Scope
from tests.discovery.heated import CAPACITY, DT, ROOM, heated_tank, moves

ROWS = 1200
STD, TIME = 2.0, 1500.0
ADAPTED = ("efficiency", "loss")


def _equations(m: Scope) -> None:
    temperature = m.state("temperature")
    room = m.site("room", ROOM + 0 * temperature, "feed", "offset", unit="K")
    heating = m.site("heating", m.parameter("efficiency") * m.input("power"), "actuator", unit="W")
    loss = m.site("heat_loss", m.parameter("loss") * (temperature - room), unit="W")
    m.derivative("temperature", (heating - loss) / CAPACITY)
    m.output("temperature", m.site("thermometer", temperature, "sensor", "offset", unit="K"))


def tank_in_a_room() -> Model:
    return replace(heated_tank(), name="tank-in-a-room", equations=_equations)


def _course(seed: int, std: float) -> FloatArray:
    memory = np.exp(-DT / TIME)
    e = np.random.default_rng(seed).standard_normal(ROWS + 500)
    return std * np.asarray(lfilter([np.sqrt(1 - memory**2)], [1, -memory], e))[500:]


def record_in_a_room(std: float, exponent: float = 0.0, seed: int = 0, dt: float = DT) -> Dataset:
    """Truth in NumPy: Euler, ten steps a row; the room wanders, and a draught takes heat (exponent not zero)."""
    inputs = np.column_stack([moves(ROWS, 500, 3000, 40, seed + 100), moves(ROWS, 5, 20, 25, seed + 200)])
    temperature, seen = 305.0, []
    for (power, fan), room in zip(inputs, ROOM + _course(seed, std), strict=True):
        loss = 80.0 * (fan / 10) ** exponent
        for _ in range(10):
            temperature += DT / 10 * (0.9 * power - loss * (temperature - room)) / CAPACITY
        seen.append(temperature)
    y = np.array(seen) + 0.05 * np.random.default_rng(seed + 1).standard_normal(ROWS)
    return Dataset("tank", dt * np.arange(1.0, ROWS + 1), dt, inputs, y[:, None])


def _fitted(record: Dataset) -> tuple[Problem, Fit, Responses]:
    problem = make_problem(record, tank_in_a_room(), ADAPTED, burn_in=30, guard=5)
    fit = Fitter(problem).fit(tank_in_a_room())
    assert fit is not None
    return problem, fit, Responses(problem, fit)


def of_the_room(std: float, problem: Problem, responses: Responses) -> Background:
    """A background whose course is that of the room, with its correlation time."""
    return background_of(problem, Spread(Course("room", std, TIME, True), 0.0, 0.0), responses)


def test_the_drop_is_that_of_a_gaussian_with_the_covariance_of_the_course() -> None:
    """Against the density of e ~ N(0, I + X K X') from SciPy, which knows nothing of the lemma."""
    rng = np.random.default_rng(0)
    X, e = rng.standard_normal((40, 5)), 2 * rng.standard_normal(40)
    root = root_of_covariance(np.linspace(0, 4000, 5), 900.0)
    for std, drop in zip(STDS, drops(X.T @ X, X.T @ e, root), strict=True):
        covariance = np.eye(40) + std**2 * X @ root @ root.T @ X.T
        expected = 2 * multivariate_normal(cov=covariance).logpdf(e) - 2 * multivariate_normal(cov=np.eye(40)).logpdf(e)
        assert drop == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_the_drop_beside_constants_is_that_of_a_gaussian_with_both(seed: int) -> None:
    """Against the densities from SciPy, for constants whose responses are much like those of the course."""
    rng = np.random.default_rng(seed)
    X, e = 30 * rng.standard_normal((40, 6)), 2 * rng.standard_normal(40)
    C = X @ rng.standard_normal((6, 3)) + 0.1 * rng.standard_normal((40, 3))
    root = root_of_covariance(np.linspace(0, 4000, 6), 900.0)
    V = np.eye(40) + C @ C.T
    left, strength, _ = np.linalg.svd(C, full_matrices=False)
    taken = strength / np.sqrt(1 + strength**2)  # V^-1 = I - left taken^2 left'
    D, turned = np.linalg.eigh(root.T @ X.T @ X @ root)
    beside = taken[:, None] * (left.T @ X @ root @ turned)
    along = turned.T @ root.T @ X.T @ np.linalg.solve(V, e)
    for std, drop in zip(STDS, gains_beside(D, along, beside), strict=True):
        covariance = V + std**2 * X @ root @ root.T @ X.T
        expected = 2 * multivariate_normal(cov=covariance).logpdf(e) - 2 * multivariate_normal(cov=V).logpdf(e)
        assert drop == pytest.approx(expected, rel=1e-6, abs=1e-5)


def test_lines_between_knots_are_what_numpy_interpolates() -> None:
    time = np.arange(0.0, 100.0)
    knots = knots_of_course(time, 96, 4)
    values = np.random.default_rng(1).standard_normal(len(knots))
    assert len(knots) == 25
    np.testing.assert_allclose(lines_between(time, knots) @ values, np.interp(time, knots, values), atol=1e-12)


def test_a_room_that_wanders_is_found_with_its_size() -> None:
    problem, fit, responses = _fitted(record_in_a_room(STD))
    spread = spread_of(problem, fit, responses)
    assert spread is not None
    course = spread.course
    assert course is not None
    assert course.site == "room"
    assert not spread.constants  # both are estimated in this model
    rate = course.std / np.sqrt(course.time)  # what a record much longer than the samples apart tells best
    assert 1 / 1.5 < rate / (STD / np.sqrt(TIME)) < 1.5
    said = background_words(background_of(problem, spread, responses), {"room": "K"})
    assert said.startswith("The room wanders: standard deviation about ")
    assert " K, " in said


@pytest.mark.parametrize("exponent", [0.0, 0.6])
def test_a_room_at_rest_does_not_wander(exponent: float) -> None:
    """Neither where nothing is missing nor where an effect is."""
    problem, fit, responses = _fitted(record_in_a_room(0.0, exponent))
    assert spread_of(problem, fit, responses) is None


def test_a_record_shorter_than_two_hours_is_not_asked() -> None:
    problem, fit, responses = _fitted(record_in_a_room(STD))
    first = replace(problem.record, time=problem.record.time / 10)
    assert spread_of(replace(problem, record=first), fit, responses) is None


def test_a_course_that_may_not_move_changes_no_fit() -> None:
    """Reduction: a standard deviation next to zero gives the fit without a course."""
    problem, fit, responses = _fitted(record_in_a_room(0.0))
    still = replace(problem, background=of_the_room(1e-9, problem, responses))
    again = Fitter(still).fit(fit.model, fit.names, like=fit, rounds=2)
    assert again is not None
    np.testing.assert_allclose(again.values, fit.values, rtol=1e-4)
    assert again.loss == pytest.approx(fit.loss, abs=0.5)
    np.testing.assert_allclose(again.background, 0.0, atol=1e-4)


def test_a_fit_with_a_course_follows_the_room_and_finds_the_parameters() -> None:
    problem, fit, responses = _fitted(record_in_a_room(STD))
    background = of_the_room(STD, problem, responses)
    allowed = Fitter(replace(problem, background=background)).fit(fit.model, fit.names, like=fit, rounds=2)
    assert allowed is not None
    rows = problem.rows("estimate")
    assert np.std(allowed.residual(problem)[rows]) < 1.5 * 0.05 < 0.1 * np.std(fit.residual(problem)[rows])
    assert np.all(np.abs(allowed.values - [0.9, 80.0]) < 4 * allowed.std())
    assert np.all(np.abs(allowed.values - [0.9, 80.0]) < np.abs(fit.values - [0.9, 80.0]) + allowed.std())


def test_the_loss_is_that_of_the_course_integrated_out() -> None:
    """Minus two log-likelihood of N(0, I + H H') for the residual without its course, but for the innovations' size."""
    problem, fit, responses = _fitted(record_in_a_room(STD))
    background = of_the_room(STD, problem, responses)
    problem = replace(problem, background=background)
    allowed = Fitter(problem).fit(fit.model, fit.names, like=fit, rounds=2)
    assert allowed is not None
    rows = problem.rows("estimate")
    e = allowed.noise.whiten(allowed.residual(problem))[rows][:, 0]
    H = allowed.noise.whiten(background.responses)[rows][:, 0]
    kept = np.isfinite(e) & (np.abs(e) < problem.clip)
    clipped = float(np.sum(np.isfinite(e) & ~kept)) * problem.clip**2
    e, H = (e + H @ allowed.background)[kept], H[kept]
    covariance = np.eye(len(e)) + H @ H.T
    expected = float(e @ np.linalg.solve(covariance, e) + np.linalg.slogdet(covariance)[1])
    sizes = 2 * float(np.log(allowed.noise.std[0])) * int(rows.sum())
    assert allowed.loss - sizes == pytest.approx(expected + clipped, abs=0.5)


def test_a_score_beside_a_course_is_that_of_generalised_least_squares() -> None:
    """With the covariance I + H H' written out, which the scorer never builds."""
    problem, fit, responses = _fitted(record_in_a_room(STD, exponent=0.6))
    background = of_the_room(STD, problem, responses)
    problem = replace(problem, background=background)
    allowed = Fitter(problem).fit(fit.model, fit.names, like=fit, rounds=2)
    assert allowed is not None
    responses = Responses(problem, allowed)
    scorer = scorer_of(problem, allowed, responses)[0]
    rows = problem.rows("estimate")

    def white(series: FloatArray) -> FloatArray:
        return scorer.noise.whiten(series)[rows][:, 0]

    e, H = white(without_spikes(allowed.residual(problem))), white(background.responses)
    kept = np.isfinite(e)
    e, H, Z = (e + H @ allowed.background)[kept], H[kept], white(responses.nuisance)[kept]
    flat = np.linalg.inv(np.linalg.cholesky(np.eye(len(e)) + H @ H.T))
    Z, e = flat @ Z, flat @ e
    e -= Z @ np.linalg.lstsq(Z, e, rcond=None)[0]
    compared = 0
    for candidate in scorer.candidates[::7]:
        score = scorer.variant_scores(candidate)[0]
        X = flat @ white(responses.of(list(score.variant.profiles)))[kept]
        size = np.linalg.norm(X, axis=0)
        X -= Z @ np.linalg.lstsq(Z, X, rcond=None)[0]
        X[:, np.linalg.norm(X, axis=0) < 1e-5 * size] = 0.0  # what is left is rounding
        gain = float(e @ X @ np.linalg.lstsq(X, e, rcond=1e-10)[0])
        assert score.gain == pytest.approx(gain, rel=1e-3, abs=1e-3), candidate.name
        compared += gain > 1.0
    assert compared >= 2


def test_the_outputs_of_a_course_are_linear_in_it() -> None:
    responses = np.arange(12.0).reshape(3, 2, 2)
    background = Background(Course("room", 1.0, 900.0, True), 0.0, responses)
    np.testing.assert_array_equal(
        background.outputs(np.array([1.0, 2.0]), tank_in_a_room()), background.responses @ [1.0, 2.0]
    )


def test_what_can_not_be_simulated_explains_nothing() -> None:
    """A response that is not finite ended the search with a defect (development record 43 of seed 2030)."""
    problem, fit, responses = _fitted(record_in_a_room(0.0))
    scorer = scorer_of(problem, fit, responses)[0]
    two = np.ones((*problem.measured.shape, 2)) * np.arange(float(len(problem.record)))[:, None, None]
    two[50, :, 1] = np.nan
    projected = scorer.projected(two)
    assert projected[:, 0].any()
    assert not projected[:, 1].any()


def test_the_background_is_looked_for_once_more_beside_the_best_effect() -> None:
    """A room that is said to wander by eight times as much takes up the draught; beside the draught it has its size."""
    problem, fit, responses = _fitted(record_in_a_room(STD, exponent=0.6))
    beside = fit_with_background(problem, Spread(Course("room", 8 * STD, TIME / 5, True), 0.0, 0.0), fit, responses)
    assert beside is not None
    found = search(*beside, tank_in_a_room()).alternatives[0]
    assert found.names == (("heat_loss", "fan_speed"),)
    again = renewed(*beside, found.fit, ["room"])
    assert again is not None
    background = again[0].background
    assert background is not None
    assert background.course is not None
    rate = background.course.std / np.sqrt(background.course.time)
    assert 1 / 1.5 < rate / (STD / np.sqrt(TIME)) < 1.5
    assert renewed(*again, search(*again, tank_in_a_room()).alternatives[0].fit, ["room"]) is None  # it stays


@pytest.mark.parametrize("seed", [0])
def test_an_effect_beside_a_room_that_wanders_is_named(seed: int) -> None:
    found = discover(tank_in_a_room(), record_in_a_room(STD / 2, exponent=0.6, seed=seed))
    assert found.verdict.word == "named", found.verdict.reason
    assert [(e.effect.site, e.effect.driver) for e in found.verdict.effects] == [("heat_loss", "fan_speed")]
    assert "The room wanders: standard deviation about" in found.verdict.reason
