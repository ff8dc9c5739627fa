"""A dependence contains the constant at its site: it may be started from there, and then says the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.candidates.score_test import Score, Scorer
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import Problem, make_problem
from adaptive_flot.discovery.results import Alternative
from adaptive_flot.discovery.search.alternatives import fit_variant
from adaptive_flot.discovery.search.halving.constants import constants
from adaptive_flot.discovery.search.halving.jobs import FittedJob
from adaptive_flot.discovery.search.halving.restarts import ADDS, unbent
from adaptive_flot.discovery.search.rounds import scorer_of
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.record import RecordSimulator
from tests.discovery.heated import Truth, heated_tank, tank_record

ADAPTED = ("efficiency", "loss")
SITE = "thermometer"


@pytest.fixture(scope="module")
def scored() -> tuple[Problem, Fit, Scorer]:
    """A record whose thermometer is off in its second half, and its scores."""
    problem = make_problem(tank_record(Truth(exponent=0.0, offset=1.0)), heated_tank(), ADAPTED, burn_in=30, guard=5)
    fit = Fitter(problem).fit(heated_tank())
    assert fit is not None
    return problem, fit, scorer_of(problem, fit)[0]


def _run(base: Fit, score: Score, fit: Fit, gain: float) -> FittedJob:
    return FittedJob(0, score, Alternative((score.candidate.name,), (True,), fit, gain, -gain))


def _variants(scorer: Scorer, driver: str, mode: str | None) -> list[Score]:
    candidate = next(c for c in scorer.candidates if c.name == (SITE, driver))
    return [s for s in scorer.variant_scores(candidate) if s.variant.effect.mode == mode]


def _fitted(problem: Problem, base: Fit, score: Score) -> Fit:
    found = fit_variant(Fitter(problem), base, score, 16)
    assert found is not None
    return found


def _run_of(problem: Problem, base: Fit, effect_of: Score, start: dict[str, float], at: Fit) -> FloatArray:
    """Outputs with the start values of a job, all else being that of a fit."""
    effect = replace(effect_of.variant.effect, coefficients=start)
    values = dict(zip(at.names, map(float, at.values), strict=True))
    model = base.model.with_parameters({n: values[n] for n in base.names}).with_effects([effect])
    run = RecordSimulator(model, problem.record.dt)
    found: FloatArray = run.outputs(problem.record, at.initial_state, model.parameter_values)[:, problem.columns]
    return found


@pytest.mark.parametrize("mode", [None, "factor"])
def test_a_dependence_starts_as_the_constant_it_contains(scored: tuple[Problem, Fit, Scorer], mode: str | None) -> None:
    """As an offset to rounding; as a factor to what the temperature moves around its usual value."""
    problem, base, scorer = scored
    (constant,) = _variants(scorer, "constant", None)[:1]
    shift = _fitted(problem, base, constant)
    curves = [s for s in _variants(scorer, "fan_speed", mode) if s.variant.effect.form == "curve"]
    assert curves
    rested = _run(base, curves[0], _fitted(problem, base, curves[0]), 0.0)
    (job,) = unbent(_run(base, constant, shift, 100.0), [rested], scorer)
    assert job.warm is shift
    there = _run_of(problem, base, job.score, job.score.start, shift)
    tolerance = 1e-9 if mode is None else 0.2 * abs(shift.model.fitted_effects()[-1].coefficients["amplitude"])
    np.testing.assert_allclose(there, shift.predicted, rtol=0, atol=tolerance)


def test_only_a_dependence_that_adds_nothing_starts_again(scored: tuple[Problem, Fit, Scorer]) -> None:
    problem, base, scorer = scored
    (constant,) = _variants(scorer, "constant", None)[:1]
    shift = _fitted(problem, base, constant)
    curve = next(s for s in _variants(scorer, "fan_speed", None) if s.variant.effect.form == "curve")
    fit = _fitted(problem, base, curve)
    reached = _run(base, constant, shift, 100.0)
    assert unbent(reached, [_run(base, curve, fit, 100.0 * (1 + 1.01 * ADDS))], scorer) == []
    assert len(unbent(reached, [_run(base, curve, fit, 100.0 * (1 + 0.99 * ADDS))], scorer)) == 1
    assert unbent(_run(base, curve, fit, 100.0), [reached], scorer) == []  # what is no constant starts nothing
    assert unbent(reached, [reached], scorer) == []


@pytest.mark.parametrize(("from_the_start", "tried"), [(True, True), (False, False)])
def test_a_constant_is_tried_where_it_is_nearly_as_good_as_a_profile(from_the_start: bool, tried: bool) -> None:
    """A thermometer that is off throughout, and one that jumps in the middle: that is no constant, to first order."""
    right = tank_record(Truth(exponent=0.0, offset=0.0 if from_the_start else 4.0))
    record = replace(right, outputs=right.outputs + 4.0) if from_the_start else right
    problem = make_problem(record, heated_tank(), ADAPTED, burn_in=30, guard=5)
    base = Fitter(problem).fit(heated_tank())
    assert base is not None
    scorer = scorer_of(problem, base)[0]
    curve = next(s for s in _variants(scorer, "time", None) if s.variant.effect.form == "curve")
    a = _run(base, curve, _fitted(problem, base, curve), 100.0).alternative
    found = [(score.candidate.name, warm) for score, warm in constants(scorer, [a])]
    assert found == ([((SITE, "constant"), a.fit)] if tried else [])


@pytest.mark.parametrize(
    ("mode", "wanted", "factor"), [(None, None, 1.0), (None, "factor", 1 / 300), ("factor", None, 300.0)]
)
def test_a_change_in_another_mode(
    scored: tuple[Problem, Fit, Scorer], mode: str | None, wanted: str | None, factor: float
) -> None:
    """An offset of 1 K is a change by one part in about 300 of the temperature."""
    assert scored[2].in_mode(SITE, mode, wanted) == pytest.approx(factor, rel=0.15)
