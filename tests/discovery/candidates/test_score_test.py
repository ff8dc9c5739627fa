"""Fits and first-order scores: parameters that made the record come back, and a score is what a full fit gains."""

from __future__ import annotations

import pickle
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from adaptive_flot.discovery.candidates.catalogue import Candidate, catalogue, finer
from adaptive_flot.discovery.candidates.responses import Responses, TimeProfile
from adaptive_flot.discovery.candidates.score_test import Scorer
from adaptive_flot.discovery.candidates.spline import spline_values
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.noise import Noise, with_rows_before
from adaptive_flot.discovery.record.problem import BoolArray, Problem, make_problem
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.forms.static import spline_basis
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.quantities import KnownEffect
from adaptive_flot.greybox.stepping.nodes import place_nodes
from adaptive_flot.greybox.stepping.stepper import Stepper
from tests.discovery.heated import DT, EXPONENT, Truth, heated_tank, tank_record

ADAPTED = ("efficiency", "loss")


def _fitted(truth: Truth, seed: int = 0) -> tuple[Problem, Fit]:
    problem = make_problem(tank_record(truth, seed=seed), heated_tank(), ADAPTED, burn_in=30, guard=5)
    fit = Fitter(problem).fit(heated_tank())
    assert fit is not None
    return problem, fit


@pytest.fixture(scope="module")
def weak() -> tuple[Problem, Fit, Scorer]:
    """A draught so weak that the model is close to linear in it."""
    problem, fit = _fitted(Truth(exponent=0.03, noise=0.02))
    responses = Responses(problem, fit)
    return problem, fit, Scorer(problem, fit, responses, catalogue(fit.model, responses))


def _candidate(scorer: Scorer, site: str, driver: str) -> Candidate:
    return next(c for c in scorer.candidates if c.name == (site, driver))


def test_splits_do_not_overlap_and_leave_guards_between_them() -> None:
    problem, _ = _fitted(Truth())
    splits = [problem.rows(s) for s in ("estimate", "confirm", "report")]
    assert not np.any(np.sum(splits, axis=0) > 1)
    assert [round(float(s.sum()) / len(problem.record), 1) for s in splits] == [0.5, 0.2, 0.2]
    assert not problem.rows()[:30].any()
    changes = np.flatnonzero(problem.splits[1:] != problem.splits[:-1])
    assert all("" in (problem.splits[k], problem.splits[k + 1]) for k in changes)


@pytest.mark.parametrize("seed", range(4))
def test_the_parameters_that_made_the_record_come_back(seed: int) -> None:
    """Model and truth agree (no draught): each parameter within four of its standard deviations, white innovations."""
    problem, fit = _fitted(Truth(exponent=0.0), seed)
    truth = np.array([0.9, 60.0])
    assert np.all(np.abs(fit.values - truth) < 4 * fit.std() + 1e-3 * truth)
    assert fit.noise.stationary_std()[0] == pytest.approx(0.05, rel=0.15)
    assert 0.85 < np.std(fit.innovations[problem.rows("estimate")]) < 1.15


def test_the_exponent_that_made_the_record_comes_back() -> None:
    problem, base = _fitted(Truth())
    draught = Effect("heat_loss", "fan_speed", "power", settings={"reference": 10.0})
    names = tuple(draught.parameter(c.name) for c in draught.terms)
    fit = Fitter(problem).fit(base.model.with_effects([draught]), names, like=base)
    assert fit is not None
    exponent = fit.names.index(draught.parameter("exponent"))
    assert abs(fit.values[exponent] - EXPONENT) < 4 * fit.std()[exponent] < 0.1
    assert fit.bic < base.bic - 100


def test_a_response_is_what_the_model_does(weak: tuple[Problem, Fit, Scorer]) -> None:
    """Linear responses against differences of two full simulations."""
    problem, fit, _ = weak
    responses = Responses(problem, fit)
    fan = problem.record.inputs[:, 1]
    response = responses.of(
        [TimeProfile("heat_loss", np.log(fan / 10), False), TimeProfile("thermometer", np.ones(600), True)]
    )
    small = 1e-4
    effects = [
        Effect("heat_loss", "fan_speed", "power", {"exponent": small}, {"reference": 10.0}),
        Effect("thermometer", "constant", "shift", {"amplitude": small}),
    ]
    for j, effect in enumerate(effects):
        runs = []
        for model in (fit.model, fit.model.with_effects([effect])):
            inputs = problem.record.inputs[1:]
            runs.append(Stepper(model, DT).simulate(fit.initial_state, inputs, model.parameter_values, DT).outputs)
        np.testing.assert_allclose(response[1:, :, j], (runs[1] - runs[0]) / small, rtol=2e-3, atol=1e-3)


@pytest.mark.parametrize("coarse", [False, True])
def test_scores_see_the_same_answers_on_the_rows_they_need(weak: tuple[Problem, Fit, Scorer], coarse: bool) -> None:
    """Responses on the rows fitted, and the few before that whitening looks back to, are the same to the bit."""
    problem, fit, _ = weak
    if coarse:
        problem = replace(problem, nodes=place_nodes(problem.record, 4))
    responses = Responses(problem, fit)
    fan = problem.record.inputs[:, 1]
    profiles = [TimeProfile("heat_loss", np.log(fan / 10), False), TimeProfile("thermometer", np.ones(600), True)]
    rows = problem.rows("estimate")
    np.testing.assert_array_equal(responses.of(profiles, rows), responses.of(profiles)[rows])
    noise = Noise(np.array([0.1]), np.array([[0.5, 0.2, 0.1]]))
    reached = with_rows_before(rows)
    every, some = noise.whiten(responses.of(profiles)), noise.whiten(responses.of(profiles, reached))
    np.testing.assert_array_equal(some[rows[reached]], every[rows])


@pytest.mark.parametrize("coarse", [False, True])
def test_a_response_does_not_depend_on_the_others(weak: tuple[Problem, Fit, Scorer], coarse: bool) -> None:
    """Profiles that move the tank and those that only the sensor shows, mixed, against each alone and against none."""
    problem, fit, _ = weak
    if coarse:
        problem = replace(problem, nodes=place_nodes(problem.record, 4))
    responses, fan, rows = Responses(problem, fit), problem.record.inputs[:, 1], problem.rows("estimate")
    profiles = [
        TimeProfile("thermometer", np.linspace(0, 1, 600), True),
        TimeProfile("heat_loss", np.log(fan / 10), False),
        TimeProfile("thermometer", fan, False),
        TimeProfile("heating", np.ones(600), False),
    ]
    together = responses.of(profiles, rows)
    for j, profile in enumerate(profiles):
        np.testing.assert_allclose(responses.of([profile], rows)[:, :, 0], together[:, :, j], rtol=1e-12, atol=1e-12)
    assert responses.of([], rows).shape == (rows.sum(), 1, 0)


def test_a_fit_that_went_through_a_pickle_has_its_model_again() -> None:
    """Fits come back from other processes without the equations, which do not pickle."""
    _, fit = _fitted(Truth())
    back = pickle.loads(pickle.dumps(fit))
    assert back.model is None
    again = back.with_model(heated_tank)
    np.testing.assert_array_equal(again.model.parameter_values, fit.model.parameter_values)
    assert fit.with_model(heated_tank) is fit


def test_a_score_is_the_gain_of_the_full_fit(weak: tuple[Problem, Fit, Scorer]) -> None:
    """Near amplitude zero the drop of the whitened sum of squares, after projection, is that of a full refit."""
    problem, fit, scorer = weak
    score = next(
        s for s in scorer.variant_scores(_candidate(scorer, "heat_loss", "fan_speed"))
        if s.variant.effect.form == "power"
    )  # fmt: skip
    effect = score.variant.effect
    names = tuple(effect.parameter(c.name) for c in effect.terms)
    full = Fitter(problem).fit(fit.model.with_effects([effect]), names, like=fit)
    assert full is not None
    rows = problem.rows("estimate")
    before, after = (scorer.noise.whiten(f.residual(problem))[rows] for f in (fit, full))
    assert score.gain == pytest.approx(float(np.sum(before**2) - np.sum(after**2)), rel=0.15)
    found = full.values[full.names.index(effect.parameter("exponent"))]
    assert score.start["exponent"] == pytest.approx(found, rel=0.15)


def test_the_truth_has_the_best_score_and_what_adaptation_can_do_has_none(weak: tuple[Problem, Fit, Scorer]) -> None:
    _, _, scorer = weak
    assert scorer.scores()[0].candidate.name == ("heat_loss", "fan_speed")
    absorbed = scorer.variant_scores(_candidate(scorer, "heat_loss", "constant"))[0]
    assert absorbed.gain < 1e-6 * scorer.scores()[0].gain


def test_noise_alone_passes_the_threshold_as_often_as_it_should() -> None:
    """Scores of records without an effect stay below the bootstrap's 99 % threshold (nominal: 0.1 of 12 pass)."""
    passed = 0
    for seed in range(12):
        problem, fit = _fitted(Truth(exponent=0.0), seed)
        responses = Responses(problem, fit)
        scorer = Scorer(problem, fit, responses, catalogue(fit.model, responses))
        passed += int(scorer.scores()[0].penalised > np.quantile(scorer.null_gains(200, seed=0), 0.99))
    assert passed <= 1


def test_the_catalogue_offers_what_makes_sense_once(weak: tuple[Problem, Fit, Scorer]) -> None:
    problem, fit, scorer = weak
    names = [c.name for c in scorer.candidates]
    assert len(set(names)) == len(names)
    assert {s for s, d in names if d in ("lag", "delay")} == {"heating", "thermometer"}
    assert {d for s, d in names if s == "heat_loss"} == {"constant", "time", "power", "fan_speed", "temperature"}
    assert {c.name for c in scorer.candidates if not c.known} >= {("thermometer", "power"), ("heating", "fan_speed")}
    # a part may be no straight line of what it passes on; a table of known effects would say so
    own = {("heating", "power"), ("thermometer", "temperature")}
    assert {c.name for c in scorer.candidates if c.known} >= own
    table = replace(fit, model=replace(fit.model, known_effects=(KnownEffect("heat_loss", "fan_speed", "a draught"),)))
    assert not {c.name for c in catalogue(table.model, Responses(problem, table)) if c.known} & own
    extended = fit.model.with_effects([Effect("heat_loss", "fan_speed", "power", settings={"reference": 10.0})])
    responses = Responses(problem, Fitter(problem).fit(extended, like=fit) or fit)
    assert ("heat_loss", "fan_speed") not in [c.name for c in catalogue(extended, responses)]
    for c in scorer.candidates:
        for v in c.variants:
            shapes = {c.name for c in v.effect.terms if c.is_shape}
            assert all(value == 0 for name, value in v.effect.coefficients.items() if name not in shapes)
            assert len(v.coefficients) == len(v.profiles)


def test_splines_pass_through_their_knots_and_a_finer_one_draws_the_same_curve(
    weak: tuple[Problem, Fit, Scorer],
) -> None:
    knots = (1.0, 2.0, 4.0, 5.0)
    np.testing.assert_allclose(spline_values(np.array(knots), knots), np.eye(4), atol=1e-12)
    np.testing.assert_allclose(spline_values(np.linspace(0, 7, 30), knots).sum(axis=1), 1.0)
    x, at = ca.SX.sym("x"), np.linspace(-1, 8, 40)
    symbolic = ca.Function("basis", [x], [ca.vertcat(*spline_basis(x, np.array(knots)))])
    np.testing.assert_allclose(spline_values(at, knots), [np.array(symbolic(v)).ravel() for v in at], atol=1e-12)
    *_, scorer = weak
    curve = next(v for v in _candidate(scorer, "heat_loss", "fan_speed").variants if v.effect.form == "curve")
    start = {n: float(k) for k, n in enumerate(curve.coefficients)}
    fine = finer(curve, start)
    assert fine is not None
    coarse, dense = (np.atleast_1d(np.asarray(v.effect.settings["knots"])) for v in (curve, fine[0]))
    np.testing.assert_allclose(list(fine[1].values()), spline_values(dense, tuple(coarse)) @ list(start.values()))


def test_what_a_candidate_explains_adds_up_over_the_outputs(weak: tuple[Problem, Fit, Scorer]) -> None:
    """The gains of single outputs are parts of the gain."""
    problem, _, scorer = weak
    for score in scorer.scores():
        parts = [scorer.gain_in_output(score, j) for j in range(len(problem.columns))]
        assert sum(parts) == pytest.approx(score.gain, rel=0.02)  # columns nearly alike: the ridge


def test_what_explodes_along_a_run_explains_nothing() -> None:
    """A curve that feeds itself holds in the run and not in its linearisation: a status, and no crash."""
    problem, fit = _fitted(Truth())
    responses = Responses(problem, fit)
    plain = responses.of

    def exploding(profiles: list[TimeProfile], rows: BoolArray | None = None) -> FloatArray:
        values = plain(profiles, rows)
        values[:, :, [p.site == "heat_loss" for p in profiles]] *= 1e200
        return values

    responses.of = exploding  # type: ignore[method-assign]
    scorer = Scorer(problem, fit, responses, catalogue(fit.model, responses))
    gains = {s.candidate.name: s.gain for s in scorer.scores()}
    assert all(np.isfinite(list(gains.values())))
    assert gains["heat_loss", "fan_speed"] == 0.0 < gains["heating", "time"]
