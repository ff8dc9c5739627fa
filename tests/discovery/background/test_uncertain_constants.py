"""Constants known to some per cent: a tank with a jacket, whose six constants are all a little off."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import multivariate_normal

from adaptive_flot.discovery.assessment.beside_background import drop_beside_background, unknown_of_background
from adaptive_flot.discovery.background import spread as spread_module
from adaptive_flot.discovery.background.evidence import Evidence, Spread
from adaptive_flot.discovery.background.fitting import background_of
from adaptive_flot.discovery.background.linear import uncertain_constants
from adaptive_flot.discovery.background.spread import spread_of
from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.background import Course
from adaptive_flot.discovery.record.problem import Problem, make_problem
from adaptive_flot.discovery.results import Judgement, OutputChange
from adaptive_flot.discovery.search.rounds import scorer_of
from adaptive_flot.discovery.verdict.report_veto import contradiction
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model, Parameter, Quantity, Scope
from tests.discovery.heated import moves

DT, ROWS, ROOM = 30.0, 900, 293.0
NOISE = 0.1  # K
WANDERS_S = 1800.0
CONSTANTS = {"heat_loss": 40.0, "exchange": 120.0, "water": 4.0e5, "jacket_wall": 1.5e5, "circulation": 0.8}


def _equations(m: Scope, wanders: bool = False) -> None:
    water, jacket = m.state("water"), m.state("jacket")
    room = m.site("room", ROOM + 0 * jacket, "feed", "offset", unit="K") if wanders else ROOM
    heating = m.site("heating", m.parameter("efficiency") * m.input("power"), "actuator", unit="W")
    pumped = m.site("circulation", CONSTANTS["circulation"] + 0.01 * m.input("pump_speed"))
    exchange = m.site("exchange", CONSTANTS["exchange"] * pumped * (jacket - water), unit="W")
    loss = m.site("heat_loss", CONSTANTS["heat_loss"] * (jacket - room), unit="W")
    m.derivative("jacket", (heating - exchange - loss) / m.site("jacket_wall", CONSTANTS["jacket_wall"] + 0 * jacket))
    m.derivative("water", exchange / m.site("water", CONSTANTS["water"] + 0 * water))
    m.output("water", m.site("thermometer", water, "sensor", "offset", unit="K"))
    m.output("jacket", m.site("jacket_thermometer", jacket, "sensor", "offset", unit="K"))


def jacketed_tank(wanders: bool = False) -> Model:
    """The tank; with a site of role feed for the room where that may wander."""
    temperatures = tuple(Quantity(n, "K", "", 273.0, 373.0, 10.0) for n in ("water", "jacket"))
    inputs = Quantity("power", "W", "", 0.0, 1e4, 1e3), Quantity("pump_speed", "1/s", "", 0.0, 100.0, 5.0)
    return Model(
        name="jacketed-tank",
        states=temperatures,
        inputs=(*inputs, Quantity("fan_speed", "1/s", "", 0.0, 100.0, 5.0)),
        parameters=(Parameter("efficiency", 0.9, "-", "data sheet", None, 0.3, 1.5, 0.05, role="estimated"),),
        outputs=(Quantity("water", "K", ""), Quantity("jacket", "K", "")),
        equations=partial(_equations, wanders=wanders),
        max_step_s=60.0,
        initial_guess={"water": 310.0, "jacket": 315.0},
    )


def record(
    off: float, exponent: float = 0.0, seed: int = 0, wander: float = 0.0, exchange: float = 0.0, one: float = 0.0
) -> Dataset:
    """Truth in NumPy: Euler, twenty steps a row; constants off by a standard deviation, a draught takes heat.

    The room wanders with the standard deviation `wander` [K] and the correlation time WANDERS_S, and the logarithm of
    the exchange with the standard deviation `exchange` and half that time. That of the heat loss is off by `one` more.
    """
    rng = np.random.default_rng(seed)
    factor = dict(zip(CONSTANTS, np.exp(off * rng.standard_normal(len(CONSTANTS))), strict=True))
    c = {name: value * factor[name] for name, value in CONSTANTS.items()}
    c["heat_loss"] *= np.exp(one)
    speeds = moves(ROWS, 20, 60, 35, seed + 300)
    inputs = np.column_stack([moves(ROWS, 500, 3000, 45, seed + 100), speeds, moves(ROWS, 5, 20, 25, seed + 200)])
    course, own = _course(WANDERS_S, seed + 400), _course(WANDERS_S / 2, seed + 500)
    water, jacket, seen = 310.0, 315.0, []
    for (power, pump, fan), room, more in zip(inputs, ROOM + wander * course, np.exp(exchange * own), strict=True):
        for _ in range(20):
            pumped = factor["circulation"] * (CONSTANTS["circulation"] + 0.01 * pump)
            flow = c["exchange"] * more * pumped * (jacket - water)
            loss = c["heat_loss"] * (fan / 10) ** exponent * (jacket - room)
            jacket += DT / 20 * (0.9 * power - flow - loss) / c["jacket_wall"]
            water += DT / 20 * flow / c["water"]
        seen.append((water, jacket))
    y = np.array(seen) + NOISE * rng.standard_normal((ROWS, 2))
    return Dataset("tank", DT * np.arange(1.0, ROWS + 1), DT, inputs, y)


def _course(time: float, seed: int) -> FloatArray:
    """A first-order autoregressive course (ROWS,) of variance one, at rest when the record starts."""
    memory = np.exp(-DT / time)
    e = np.random.default_rng(seed).normal(size=2 * ROWS)
    return np.asarray(lfilter([np.sqrt(1 - memory**2)], [1, -memory], e))[ROWS:]


def fitted(measured: Dataset, wanders: bool = False) -> tuple[Problem, Fit, Responses]:
    model = jacketed_tank(wanders)
    problem = make_problem(measured, model, ("efficiency",), burn_in=30, guard=5)
    fit = Fitter(problem).fit(model)
    assert fit is not None
    return problem, fit, Responses(problem, fit)


def test_constants_are_those_of_the_process_that_are_not_fitted() -> None:
    assert set(uncertain_constants(fitted(record(0.0))[2])) == set(CONSTANTS)


def test_constants_that_are_right_are_not_told_to_be_off() -> None:
    assert spread_of(*fitted(record(0.0))) is None


@pytest.mark.parametrize(("worse", "course", "taken"), [(5.0, False, True), (15.0, False, False), (5.0, True, False)])
def test_constants_that_explain_as_much_as_an_effect_are_what_is_off(
    monkeypatch: pytest.MonkeyPatch, worse: float, course: bool, taken: bool
) -> None:
    """A feed that wanders is not always there: it must be surely better."""
    problem, base, responses = fitted(record(0.0, exponent=0.3))
    scorer = scorer_of(problem, base, responses)[0]
    extended = spread_module._with_best_effect(problem, base, scorer)
    assert extended is not None and extended.bic < base.bic - 20  # an effect that is there
    wandering = Course("heat_loss", 1.0, 3600.0, False) if course else None
    background = Spread(course=wandering, constants=0.05, evidence=1e6)

    def as_good(*_: object) -> list[tuple[Spread, float]]:
        return [(background, extended.bic + worse)]

    monkeypatch.setattr(spread_module, "_fitted", as_good)
    monkeypatch.setattr(Evidence, "best", background)
    monkeypatch.setattr(Evidence, "but_for_what_stands_out", lambda _, spread: spread)
    monkeypatch.setattr(spread_module, "MOST_BEFORE", 1)
    assert (spread_of(problem, base, responses, scorer) == background) == taken


def test_constants_that_are_off_are_found_with_their_size() -> None:
    sizes = []
    for seed in range(2, 6):
        spread = spread_of(*fitted(record(0.1, seed=seed)))
        assert spread is not None
        assert spread.course is None
        sizes.append(spread.constants)
    assert 0.05 < float(np.mean(sizes)) < 0.2


def test_the_evidence_is_that_of_a_gaussian_with_the_covariance_of_the_constants() -> None:
    """Against the density of e ~ N(0, I + s^2 C C') from SciPy, which knows nothing of the lemma."""
    problem, fit, responses = fitted(record(0.08, seed=1))
    scorer = scorer_of(problem, fit, responses)[0]
    best = Evidence(problem, scorer, responses, []).best
    ones = background_of(problem, replace(best, constants=1.0), responses).responses
    C, e = scorer.projected(ones), scorer.residual

    def density(s: float) -> float:
        return float(multivariate_normal(cov=np.eye(len(e)) + s**2 * C @ C.T).logpdf(e))

    drop = 2 * (density(best.constants) - density(0.0))
    price = float(np.log(problem.count(problem.rows("estimate"))))
    assert best.evidence == pytest.approx(drop - price, rel=1e-6, abs=1e-3)


def test_a_constant_that_is_far_off_does_not_widen_the_others() -> None:
    """Twelve constants that each move the residual by themselves: eleven within 5 %, one off by 60 %."""
    problem, fit, responses = fitted(record(0.0))
    evidence = Evidence(problem, scorer_of(problem, fit, responses)[0], responses, [])
    off = np.concatenate([0.05 * np.random.default_rng(0).standard_normal(11), [0.6]])
    strength, evidence.count = 1000.0, len(off)
    evidence._turned, evidence._own = strength * np.eye(len(off)), strength * off
    alone = evidence.but_for_what_stands_out(evidence.best)
    assert evidence.best.constants == 0.2
    assert alone.constants in (0.04, 0.07)
    assert alone.evidence > evidence.best.evidence + 10


def test_constants_that_may_not_move_change_no_fit() -> None:
    """Reduction: a standard deviation next to zero gives the fit without a background."""
    problem, fit, responses = fitted(record(0.08, seed=1))
    still = replace(problem, background=background_of(problem, Spread(None, 1e-9, 0.0), responses))
    plain, again = (Fitter(p).fit(fit.model, fit.names, like=fit, rounds=2) for p in (problem, still))
    assert plain is not None
    assert again is not None
    np.testing.assert_allclose(again.values, plain.values, rtol=1e-4)
    assert again.loss == pytest.approx(plain.loss, abs=0.5)


@pytest.mark.parametrize("seed", [1])
def test_an_effect_beside_constants_that_are_off_is_named(seed: int) -> None:
    found = discover(jacketed_tank(), record(0.05, exponent=0.5, seed=seed))
    assert found.verdict.word == "named", found.verdict.reason
    names = [(e.effect.site, e.effect.driver) for e in found.verdict.effects]
    assert ("heat_loss", "fan_speed") in names
    assert all(site in CONSTANTS and driver == "constant" for site, driver in names if driver != "fan_speed")


def test_constants_alone_are_no_name() -> None:
    found = discover(jacketed_tank(), record(0.05, seed=4))
    assert found.verdict.word == "none", found.verdict.reason
    assert "Constants of the process are not quite those of the model" in found.verdict.reason


def test_what_the_background_leaves_unknown_is_its_posterior() -> None:
    """Two rows that were fitted and one that was not, written out."""
    problem, fit, responses = fitted(record(0.08, seed=1))
    background = background_of(problem, Spread(None, 0.1, 0.0), responses)
    problem = replace(problem, background=background)
    rows = problem.rows("estimate", "confirm")
    H = fit.noise.whiten(background.responses)[rows]
    present = np.isfinite(problem.measured[rows])
    precision = np.eye(background.responses.shape[2])
    for h in H[present]:
        if np.isfinite(h).all():
            precision += np.outer(h, h)
    own: FloatArray = background.responses[problem.rows("report"), 0]
    expected = np.sqrt(np.mean([h @ np.linalg.solve(precision, h) for h in own]))
    splits = ("estimate", "confirm"), "report"
    size, limit = unknown_of_background(problem, fit, *splits)
    assert size[0] == pytest.approx(expected, rel=1e-6)
    covariance = np.linalg.inv(precision)
    drawn = np.random.default_rng(0).multivariate_normal(np.zeros(len(covariance)), covariance, 20_000)
    errors = np.sqrt(np.mean((drawn @ own.T) ** 2, axis=1))
    assert np.mean(errors > limit[0]) == pytest.approx(0.05 / len(problem.columns), abs=0.012)
    for none in unknown_of_background(replace(problem, background=None), fit, *splits):
        assert not none.any()


def test_a_little_worse_within_what_the_background_leaves_unknown_contradicts_nothing() -> None:
    judged = Judgement("named", None, (), (), 10.0)
    better = OutputChange("water", "K", 2.0, 1.0, 0.1, (0.4, 0.6))

    def jacket(after: float) -> OutputChange:
        return OutputChange("jacket", "K", 2.0, after, 1.0, (-0.05, -0.01))

    noise = np.array([0.1, 1.0])
    assert contradiction(judged, (better, jacket(2.06)), noise)
    assert not contradiction(judged, (better, jacket(2.06)), noise, np.array([0.0, 2.0]))
    assert contradiction(judged, (better, jacket(2.06)), noise, np.array([0.0, 0.5]))
    assert contradiction(judged, (better, jacket(2.3)), noise, np.array([0.0, 2.0]))


def test_the_likelihood_beside_a_background_is_that_of_a_gaussian() -> None:
    """Against the density of e ~ N(0, I + H H') from SciPy, for two fits with the same noise."""
    problem, fit, responses = fitted(record(0.05, seed=1))
    problem = replace(problem, background=background_of(problem, Spread(None, 0.05, 0.0), responses))
    beside = Fitter(problem).fit(fit.model, fit.names, like=fit, rounds=2)
    assert beside is not None
    other = replace(beside, predicted=beside.predicted + 0.02)
    background, rows = problem.background, problem.rows("confirm")
    assert background is not None

    def density(f: Fit) -> float:
        plain = f.predicted - background.responses @ f.background
        e = f.noise.whiten((problem.measured - plain) / problem.weights)[rows]
        H = f.noise.whiten(background.responses / problem.weights[:, :, None])[rows]
        kept = np.isfinite(e)
        return float(multivariate_normal(cov=np.eye(int(kept.sum())) + H[kept] @ H[kept].T).logpdf(e[kept]))

    expected = 2 * (density(beside) - density(other))
    assert drop_beside_background(problem, other, beside, "confirm") == pytest.approx(expected, abs=0.5)


@pytest.mark.parametrize("seed", [0, 1])
def test_constants_that_are_off_and_a_room_that_wanders_are_found_together(seed: int) -> None:
    """Each alone would be taken for coloured noise beside the other."""
    spread = spread_of(*fitted(record(0.1, seed=seed, wander=1.0), wanders=True))
    assert spread is not None
    assert spread.numbers == 3
    assert spread.course is not None
    assert spread.course.site == "room"
    rate = spread.course.std / np.sqrt(spread.course.time)
    assert 1 / 1.6 < rate / (1.0 / np.sqrt(WANDERS_S)) < 1.6
    assert 0.04 <= spread.constants <= 0.2
