"""A constant far off, and a second course, beside a room that wanders and constants that are all a little off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from adaptive_flot.discovery.assessment.likelihood import LEAST_EVIDENCE
from adaptive_flot.discovery.background.evidence import Spread, price
from adaptive_flot.discovery.background.fitting import (
    background_of,
    fit_with_background,
    taken_up,
    with_course_told,
    without_background,
    without_constants,
)
from adaptive_flot.discovery.background.told_course import with_courses
from adaptive_flot.discovery.background.two_courses import TwoCourses
from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.background import Course
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Judgement, OutputChange, SearchResult
from adaptive_flot.discovery.search.rounds import scorer_of
from adaptive_flot.discovery.verdict.report_veto import contradiction
from adaptive_flot.discovery.verdict.words.wording import beside_words
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.record import RecordSimulator
from tests.discovery.background.test_uncertain_constants import WANDERS_S, fitted, jacketed_tank, record

OFF, ONE, SEED = 0.02, -1.0, 8
ROOM = Course("room", 2.0, WANDERS_S, True)


def beside_the_room(measured: Dataset, constants: float = 0.03) -> tuple[Problem, Fit]:
    """The fit of the tank in a room that wanders, with its constants a little off."""
    problem, fit, responses = fitted(measured, wanders=True)
    made = fit_with_background(problem, Spread(ROOM, constants, 0.0), fit, responses)
    assert made is not None
    return made


def test_a_constant_that_is_told_has_its_whole_size() -> None:
    """Its interval holds the truth, though the background has the same constant, and no held-out error falls."""
    verdict = discover(jacketed_tank(wanders=True), record(OFF, wander=1.0, seed=SEED, one=ONE)).verdict
    assert verdict.word == "named", verdict.reason
    (told,) = verdict.effects
    assert (told.effect.site, told.effect.driver) == ("heat_loss", "constant")
    truth = OFF * np.random.default_rng(SEED).standard_normal() + ONE
    low, high = told.interval95["amplitude"]
    assert low < truth < high
    assert "less likely by a factor of e^" in verdict.reason


def test_without_a_constant_the_background_leaves_it_as_it_came() -> None:
    problem, base = beside_the_room(record(OFF, wander=2.0, seed=1, one=-0.4))
    beside, fit = without_constants(problem, base, {"heat_loss"})
    assert taken_up(problem, {"heat_loss"})
    background = beside.background
    assert background is not None
    k = background.responses.shape[2] - len(background.sites) + background.sites.index("heat_loss")
    assert fit.background[k] == pytest.approx(0.0, abs=1e-9)
    assert fit.loss > base.loss + LEAST_EVIDENCE  # the others can not quite stand in for it
    assert without_constants(problem, base, {"heating"}) == (problem, base)


def test_the_evidence_for_two_courses_is_that_of_a_gaussian() -> None:
    """Against the density of e ~ N(0, I + B B') from SciPy, with the numbers that were found."""
    problem, fit, responses = fitted(record(OFF, wander=2.0, exchange=0.3, seed=2), wanders=True)
    scorer = scorer_of(problem, fit, responses)[0]
    best = TwoCourses(problem, scorer, responses).best(Spread(ROOM, 0.04, 0.0), "exchange")
    assert best.told is not None
    B = scorer.projected(background_of(problem, best, responses).responses)
    e, none = scorer.residual, np.eye(len(scorer.residual))

    def density(covariance: FloatArray) -> float:
        return float(multivariate_normal(cov=covariance).logpdf(e))

    drop = 2 * (density(none + B @ B.T) - density(none)) - best.numbers * price(problem)
    assert best.evidence == pytest.approx(drop, rel=1e-6, abs=1e-3)


def searched(measured: Dataset, processes: int = 1) -> tuple[Problem, SearchResult, SearchResult]:
    """What was told beside the room (nothing), and what is with a second course."""
    problem, base = beside_the_room(measured)
    nothing = SearchResult(base, (), (), None, 0.0, 0.0, scorer_of(problem, base)[1])
    again, result = with_courses(problem, nothing, processes)
    return again, nothing, result


def test_an_exchange_that_wanders_is_found_beside_the_room() -> None:
    """The circulation is a factor of it, so that the two are one; nothing else comes near."""
    _, _, result = searched(record(OFF, wander=2.0, exchange=0.8, seed=2))
    assert {a.names[0] for a in result.alternatives[:2]} == {("exchange", "time"), ("circulation", "time")}
    assert all(a.delta_bic > result.alternatives[0].delta_bic + LEAST_EVIDENCE for a in result.alternatives[2:])
    parted = searched(record(OFF, wander=2.0, exchange=0.8, seed=2), processes=2)[2]  # a fit comes without its model
    assert [(a.names, a.fit.bic) for a in parted.alternatives] == [(a.names, a.fit.bic) for a in result.alternatives]
    for one, other in zip(parted.alternatives, result.alternatives, strict=True):
        np.testing.assert_array_equal(one.fit.model.parameter_values, other.fit.model.parameter_values)
    best = result.alternatives[0]
    assert result.verification is not None
    assert result.verification.confirmed
    own = best.problem
    assert own is not None
    assert own.background is not None
    assert own.background.told is not None
    # the model itself has the course: a run of it, with the room that is beside it, is what was predicted
    model = with_course_told(own, best.fit).model
    free = RecordSimulator(model, own.record.dt).outputs(own.record, best.fit.initial_state, model.parameter_values)
    there = free[:, list(own.columns)] + own.background.outputs(best.fit.background, model)
    np.testing.assert_allclose(there, best.fit.predicted, atol=0.02)


@pytest.mark.parametrize("seed", [3, 4])
def test_a_room_that_wanders_alone_has_no_second_course(seed: int) -> None:
    _, nothing, result = searched(record(OFF, wander=2.0, seed=seed))
    assert result is nothing


def test_the_values_of_a_told_course_have_the_covariance_of_their_components() -> None:
    problem, base = beside_the_room(record(OFF, wander=2.0, exchange=0.3, seed=2))
    bare = without_background(problem, base)
    plain = replace(problem, background=None)
    told = Course("exchange", 0.2, 900.0, False)
    knots = np.linspace(plain.record.time[0], plain.record.time[-1], 96)
    extended = replace(bare, model=bare.model.with_effects([told.effect(knots)]))
    made = fit_with_background(plain, Spread(ROOM, 0.03, 0.0, told=told), extended, Responses(plain, bare))
    assert made is not None
    fit = with_course_told(*made)
    own = slice(len(made[1].names), None)
    assert len(fit.names[own]) == 96
    spread = np.sqrt(np.diag(fit.covariance[own, own]))
    assert np.all((spread > 0) & (spread < 1.05 * told.std))  # never less certain than before the record


def test_likelier_rows_excuse_what_the_background_does_not_know() -> None:
    judged = Judgement("named", None, (), (), 10.0)
    better = OutputChange("water", "K", 2.0, 1.0, 0.1, (0.4, 0.6))
    worse = OutputChange("jacket", "K", 2.0, 2.6, 1.0, (-0.5, -0.1))
    alike = OutputChange("water", "K", 2.0, 2.0, 0.1, (-0.01, 0.01))
    noise = np.array([0.1, 1.0])
    unknown = np.array([0.0, 2.5])
    assert contradiction(judged, (better, worse), noise, unknown)
    assert not contradiction(judged, (better, worse), noise, unknown, likelier=True)
    assert contradiction(judged, (better, worse), noise, unknown / 5, likelier=True)
    assert contradiction(judged, (alike,), noise[:1], likelier=True)
    assert contradiction(judged, (alike,), noise[:1], alike=True)
    assert not contradiction(judged, (alike,), noise[:1], likelier=True, alike=True)
    unsure = OutputChange("water", "K", 2.0, 1.4, 0.1, (-0.01, 0.5))
    assert contradiction(judged, (unsure,), noise[:1])
    assert not contradiction(judged, (unsure,), noise[:1], likelier=True)
    little = OutputChange("water", "K", 2.0, 1.85, 0.1, (-0.01, 0.15))
    assert contradiction(judged, (little,), noise[:1], likelier=True)


def test_the_reason_says_what_a_name_rests_on_where_no_error_is_surely_smaller() -> None:
    assert not beside_words(0.0, smaller=True)
    assert "stays as it is" in beside_words(40.0) and "e^20" in beside_words(40.0)
    assert "interval reaches zero" in beside_words(40.0, smaller=True) and "e^20" in beside_words(40.0, smaller=True)
