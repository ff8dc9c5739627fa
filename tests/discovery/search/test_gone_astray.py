"""A fit that went astray is made once more from where the best is: a curve from nothing, a constant from its curve."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.candidates.spline import knots_of
from adaptive_flot.discovery.candidates.variant import Variant
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import make_problem
from adaptive_flot.discovery.results import Alternative
from adaptive_flot.discovery.search.halving.constants import flat
from adaptive_flot.discovery.search.halving.events import EDGE_ROWS, ramps_and_washouts, slow_switches, soft_edges
from adaptive_flot.discovery.search.halving.jobs import FittedJob, Job, ScoredLinearisation
from adaptive_flot.discovery.search.halving.refits import Refit
from adaptive_flot.discovery.search.halving.restarts import _gone_astray, as_event_of, flattened
from adaptive_flot.discovery.search.rounds import scorer_of
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect
from tests.discovery.heated import Truth, changed, heated_tank, tank_record

SENSOR, LOSS = ("thermometer", "time"), ("heat_loss", "time")


def _halving(record: Dataset) -> Refit:
    """A refit of a record of the tank, with changes in time at its loss and its thermometer."""
    problem = make_problem(record, heated_tank(), ("efficiency", "loss"), burn_in=30, guard=5, cycles=20)
    fitter = Fitter(problem)
    base = fitter.fit(heated_tank())
    assert base is not None
    scorer = scorer_of(problem, base)[0]
    linearisation = ScoredLinearisation(scorer, [s for s in scorer.scores() if s.candidate.name in (SENSOR, LOSS)])
    return Refit(fitter, base, [linearisation], None, 1, lambda what: None)


@pytest.fixture(scope="module")
def halving() -> Refit:
    """The thermometer shows 0.5 K more from the middle of the record on."""
    return _halving(tank_record(Truth(exponent=0.0, offset=0.5)))


def _curve(halving: Refit, name: tuple[str, str], gain: float) -> FittedJob:
    """A curve in time of a name, as if its fit had gained so much."""
    linearisation = halving.linearisations[0]
    candidate = next(s.candidate for s in linearisation.scores if s.candidate.name == name)
    score = next(s for s in linearisation.scorer.variant_scores(candidate) if s.variant.effect.family.is_curve)
    fit = replace(halving.base, model=heated_tank().with_effects([score.variant.effect]))
    fit = replace(fit, bic=halving.base.bic - gain)
    return FittedJob(0, score, Alternative((name,), (True,), fit, gain, -gain))


def _astray(halving: Refit, sensor: float, loss: float, best: Fit) -> list[Job]:
    first = [_curve(halving, SENSOR, sensor), _curve(halving, LOSS, loss)]
    return _gone_astray(halving, first, first, best)


def test_a_curve_that_promised_as_much_and_came_to_little_is_fitted_from_the_best_constants(
    halving: Refit, monkeypatch: pytest.MonkeyPatch
) -> None:
    best = halving.base
    monkeypatch.setattr(halving, "tied", lambda: {SENSOR, LOSS})
    (job,) = _astray(halving, 1000.0, 300.0, best)
    assert job.score.candidate.name == LOSS and job.warm is best and job.drawn
    assert _astray(halving, 1000.0, 800.0, best) == []


def test_what_promised_less_stays_where_it_is(halving: Refit, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(halving, "tied", lambda: {SENSOR})
    assert _astray(halving, 1000.0, 300.0, halving.base) == []


def test_it_starts_from_nothing_with_the_knots_of_a_finalist(halving: Refit) -> None:
    curve = _curve(halving, LOSS, 100.0)
    job = flattened(curve, halving.base)
    assert set(job.score.start.values()) == {0.0}
    assert len(knots_of(job.score.variant.effect)) == 2 * len(knots_of(curve.score.variant.effect))


def test_a_constant_is_fitted_once_more_from_a_curve_that_came_further() -> None:
    """The thermometer shows 2 K too much all the time. The constant is as if it had come to rest far from there."""
    plain = tank_record(Truth(exponent=0.0))
    halving = _halving(changed(plain, plain.outputs[:, 0] + 2.0))
    scorer = halving.linearisations[0].scorer
    candidate = next(s.candidate for s in scorer.scores() if s.candidate.name == ("thermometer", "constant"))
    score = scorer.variant_scores(candidate)[0]
    poor = replace(halving.base, model=heated_tank().with_effects([score.variant.effect]))
    resting = FittedJob(0, score, Alternative((candidate.name,), (True,), poor, 0.0, 0.0))
    curve = halving.run([Job(0, _curve(halving, SENSOR, 0.0).score)])[0]
    (constant,) = flat(halving, [curve, resting])
    assert constant.alternative.names == (("thermometer", "constant"),)
    assert constant.alternative.fit.bic < curve.alternative.fit.bic < halving.base.bic
    assert flat(halving, [resting]) == []
    assert len(flat(halving, [_rising(curve, 0.02)])) == 1, "no constant was fitted, and the curve is a level"
    assert flat(halving, [_rising(curve, 0.3)]) == []


def _rising(curve: FittedJob, by: float) -> FittedJob:
    """A fitted curve, with values that begin at 2 and rise from knot to knot."""
    (effect,), fit = curve.alternative.effects, curve.alternative.fit
    values = {name: 2.0 + by * k for k, name in enumerate(effect.coefficients)}
    model = heated_tank().with_effects([replace(effect, coefficients=values)])
    return replace(curve, alternative=replace(curve.alternative, fit=replace(fit, model=model)))


def _pulse(halving: Refit, name: tuple[str, str]) -> FittedJob:
    """A pulse of a name, as if it had been fitted."""
    curve = _curve(halving, name, 100.0)
    values = {"amplitude": 0.3, "on_1": 6000.0, "for_1": 3000.0}
    effect = Effect(*name, "switch", values, {"count": 1.0, "width": 45.0})
    fit = replace(curve.alternative.fit, model=heated_tank().with_effects([effect]))
    return replace(curve, alternative=replace(curve.alternative, fit=fit))


def test_a_rival_of_an_event_is_fitted_as_the_same_event(halving: Refit) -> None:
    """At its times and constants, with no size yet; not at its own site, and nothing that is no change in time."""
    leader, rival = _pulse(halving, SENSOR), _curve(halving, LOSS, 90.0)
    (job,) = as_event_of(rival, leader)
    effect = job.score.variant.effect
    assert (effect.site, effect.driver, effect.form) == (*LOSS, "switch") and job.warm is leader.alternative.fit
    assert job.score.start == {"amplitude": 0.0, "on_1": 6000.0, "for_1": 3000.0}
    assert as_event_of(leader, leader) == []


def test_a_pulse_is_tried_with_softer_edges_and_nothing_else_is(halving: Refit) -> None:
    """With no edge that would take up the pulse, which lasts for 100 rows."""
    jobs = soft_edges(_pulse(halving, SENSOR), 30.0)
    assert [job.score.variant.effect.settings["width"] for job in jobs] == [30.0 * rows for rows in EDGE_ROWS[:3]]
    assert all(job.score.start["on_1"] == 6000.0 for job in jobs)
    assert soft_edges(_curve(halving, SENSOR, 10.0), 30.0) == []


def test_a_switch_is_tried_with_other_speeds(halving: Refit) -> None:
    """All but its own, from where it stands; other forms have none."""
    curve = _curve(halving, LOSS, 100.0)
    values = {"off": -0.1, "on": 0.2, "on_above": 14.0, "off_below": 9.0}
    effect = Effect("heat_loss", "fan_speed", "two_levels", values, {"follow_s": 120.0})
    fit = replace(curve.alternative.fit, model=heated_tank().with_effects([effect]))
    jobs = slow_switches(replace(curve, alternative=replace(curve.alternative, fit=fit)), 30.0)
    assert [job.score.variant.effect.settings["follow_s"] for job in jobs] == [30.0, 360.0, 1080.0]
    assert all(job.score.start == values and job.warm is fit for job in jobs)
    assert slow_switches(curve, 30.0) == []


def test_a_washout_is_fitted_again_from_a_ramp_that_came_further() -> None:
    """The thermometer comes to show 2 K more from 9000 s on, with a time constant of 1000 s."""
    plain = tank_record(Truth(exponent=0.0))
    settling = 1 - np.exp(-np.maximum(plain.time - 9000.0, 0.0) / 1000.0)
    halving = _halving(changed(plain, plain.outputs[:, 0] + 2.0 * settling))
    score = _curve(halving, SENSOR, 0.0).score
    begun = ("onset", 9000.0), ("duration", 2500.0)
    variant = Variant(Effect(*SENSOR, "ramp", mode="offset"), (), ("amplitude",), begun)
    (ramp,) = halving.run([Job(0, replace(score, variant=variant, start={"amplitude": 2.0, **dict(begun)}))])
    (washout,) = ramps_and_washouts(halving, [ramp])
    found = washout.alternative.effects[-1]
    assert found.form == "washout" and washout.alternative.fit.bic < ramp.alternative.fit.bic
    assert found.coefficients["onset"] == pytest.approx(9000.0, abs=100.0)
    assert found.coefficients["time_constant"] == pytest.approx(1000.0, rel=0.15)
    (again,) = ramps_and_washouts(halving, [washout])
    assert again.alternative.effects[-1].form == "ramp"
    assert washout.alternative.fit.bic < again.alternative.fit.bic < ramp.alternative.fit.bic
    assert ramps_and_washouts(halving, [_curve(halving, SENSOR, 10.0)]) == []
