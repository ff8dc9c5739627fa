"""Detection and location: nothing is seen in noise, what is missing is seen where and since when it acts."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.discovery.assessment.detect import detect, independence
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import Problem, make_problem
from adaptive_flot.discovery.results import Detection, Discovery, Symptom
from adaptive_flot.discovery.verdict.locate import locate
from tests.discovery.heated import DT, Truth, heated_tank, tank_record


def _fitted(truth: Truth, seed: int = 0, rows: int = 600) -> tuple[Problem, Fit]:
    record = tank_record(truth, rows, seed)
    problem = make_problem(record, heated_tank(), ("efficiency", "loss"), burn_in=30, guard=5)
    fit = Fitter(problem).fit(heated_tank())
    assert fit is not None
    return problem, fit


def _symptom(truth: Truth, seed: int = 0) -> Symptom:
    (found,) = detect(*_fitted(truth, seed)).symptoms
    return found


def test_a_model_that_lacks_nothing_shows_nothing() -> None:
    """At 5 % over all tests, at most a few of twenty records may."""
    shows = [_symptom(Truth(exponent=0.0), seed).shows for seed in range(20)]
    assert sum(shows) <= 4
    assert 0.9 < _symptom(Truth(exponent=0.0)).size < 1.15


def test_a_missing_relation_follows_the_input_that_drives_it() -> None:
    found = _symptom(Truth())
    assert found.shows and found.size > 3 and found.white < 1e-6
    assert found.inputs["fan_speed"] < 1e-6
    assert "fan_speed" in str(found)


def test_an_event_is_seen_when_it_happens() -> None:
    found = _symptom(Truth(exponent=0.0, offset=0.4))
    assert found.shows and found.onset_s is not None
    assert found.onset_s == pytest.approx(300 * DT, abs=10 * DT)


def test_feedback_is_no_reason() -> None:
    """An input that follows the past noise of the output (a controller) explains nothing of what comes after."""
    rng = np.random.default_rng(0)
    noise = rng.standard_normal(3000)
    fed_back = np.concatenate([[0.0], noise[:-1]])
    assert independence(noise, fed_back) > 0.01
    assert independence(np.concatenate([[0.0], noise[:-1]]), noise) < 1e-6


def test_a_short_or_missing_output_is_no_crash() -> None:
    problem, fit = _fitted(Truth(), rows=150)
    (found,) = detect(problem, fit).symptoms
    assert not found.shows and np.isnan(found.white) and np.isnan(found.inputs["power"])


def test_the_place_is_that_of_the_best_candidate(draught: Discovery) -> None:
    assert draught.verdict.detection is not None and draught.search is not None
    found = locate(draught.verdict.detection, draught.search.rounds[0].scores)
    assert found.outputs == ("temperature",)
    assert (found.places[0].share, found.causes[0].share) == (1.0, 1.0)
    assert found.causes[0].kind == "with the operating point"
    assert all(0 <= p.share <= 1 for p in (*found.places, *found.causes))
    assert {p.kind for p in found.places} == {"process", "actuator", "sensor"}
    assert str(found).startswith("shows in temperature; to first order: ")


def test_nothing_scored_is_no_place() -> None:
    assert locate(Detection(()), ()).places == ()
