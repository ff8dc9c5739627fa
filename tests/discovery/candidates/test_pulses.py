"""A change that lasts for a while is found from its two edges, as one who tries every pulse by itself would find it."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.discovery.candidates.responses import TimeProfile
from adaptive_flot.discovery.candidates.score_test import Scorer
from adaptive_flot.discovery.candidates.shapes.pulses import PULSE, with_pulses
from adaptive_flot.discovery.candidates.shapes.step_events import freer, slow, step_score
from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import make_problem
from adaptive_flot.discovery.record.screening import Suspect
from adaptive_flot.discovery.search.rounds import scorer_of, threshold_of
from adaptive_flot.discovery.verdict.words.curve import effect_curves
from adaptive_flot.discovery.verdict.words.sizes import words_of_effects
from adaptive_flot.discovery.verdict.words.suspects import event_times, suspect_notes
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect
from tests.discovery.heated import DT, Truth, changed, heated_tank, tank_record

FIRST, LAST, SIZE = 130, 270, 0.6
"""Rows between which the thermometer shows more, and by how much [K]: twelve times the noise."""
KNOWN = Truth(exponent=0.0)


def with_a_pulse(first: int = FIRST, last: int = LAST, size: float = SIZE, seed: int = 0) -> Dataset:
    plain = tank_record(KNOWN, seed=seed)
    outputs = plain.outputs[:, 0].copy()
    outputs[first:last] += size
    return changed(plain, outputs)


def scored(record: Dataset) -> Scorer:
    problem = make_problem(record, heated_tank(), ("efficiency", "loss"), burn_in=30, guard=5, cycles=20)
    fit = Fitter(problem).fit(heated_tank())
    assert fit is not None
    return scorer_of(problem, fit)[0]


def test_a_pulse_is_found_where_and_when_it_is() -> None:
    best = with_pulses(scorer := scored(with_a_pulse()), scorer.scores())[0]
    assert best.candidate.name == ("thermometer", "time")
    assert best.variant.effect.form == PULSE
    begin, end = best.start["on_1"], best.start["on_1"] + best.start["for_1"]
    for found, true in ((begin, DT * (FIRST + 1)), (end, DT * (LAST + 1))):
        time = scorer.problem.record.time
        between = (time > min(found, true)) & (time < max(found, true)) & scorer.rows
        assert between.sum() <= 3, f"an edge at {true} s was taken for one at {found} s"
    assert best.start["amplitude"] == pytest.approx(SIZE, rel=0.2)


def test_no_other_pulse_between_the_times_tried_is_better() -> None:
    """Against each pulse scored by itself as an own profile, which knows nothing of pairs of edges."""
    scorer = scored(with_a_pulse())
    time = scorer.problem.record.time
    best = next(s for s in with_pulses(scorer, scorer.scores()) if s.candidate.name == ("thermometer", "time"))
    rng, gains = np.random.default_rng(1), []
    for _ in range(200):
        first, last = sorted(rng.uniform(time[0], time[-1], 2))
        inside = TimeProfile("thermometer", ((time >= first) & (time < last)).astype(float), True)
        x = scorer.projected_profiles([inside])[:, 0]
        gains.append(float(x @ scorer.residual) ** 2 / max(float(x @ x), 1e-12))
    assert best.gain >= max(gains)
    (x,) = scorer.projected_profiles(list(best.variant.profiles)).T
    assert best.gain == pytest.approx(float(x @ scorer.residual) ** 2 / float(x @ x), rel=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_noise_has_no_pulse_above_the_threshold(seed: int) -> None:
    scorer = scored(tank_record(KNOWN, seed=seed))
    best = with_pulses(scorer, scorer.scores())[0]
    assert best.penalised < threshold_of(scorer)


def test_a_record_of_less_than_two_hours_may_have_a_pulse() -> None:
    plain = tank_record(KNOWN, rows=230)
    outputs = plain.outputs[:, 0].copy()
    outputs[90:150] += SIZE
    best = with_pulses(scorer := scored(changed(plain, outputs)), scorer.scores())[0]
    assert (best.candidate.name, best.variant.effect.form) == (("thermometer", "time"), PULSE)
    time = scorer.problem.record.time
    between = (time > best.start["on_1"]) & (time < 91 * DT) & scorer.rows
    assert between.sum() <= 3, "no row that was fitted may lie between the edge and the one that was found"


def test_a_pulse_is_told_with_its_size_and_both_its_times() -> None:
    found = discover(heated_tank(), with_a_pulse())
    verdict = found.verdict
    assert verdict.word == "named", verdict.reason
    (told,) = verdict.effects
    assert (told.effect.site, told.effect.driver, told.effect.form) == ("thermometer", "time", PULSE)
    low, high = told.interval95["amplitude"]
    assert low < SIZE < high
    said = words_of_effects(heated_tank(), [told], [])
    assert said.startswith("Thermometer showed 0.6")
    on, lasted = told.effect.coefficients["on_1"], told.effect.coefficients["for_1"]
    assert f"from {on:.0f} s to {on + lasted:.0f} s than before and after" in said
    assert found.problem is not None and found.after is not None
    (curve,) = effect_curves(found.problem, found.after, 1)
    assert np.any((curve.change > 0.1 * SIZE) & (curve.change < 0.9 * SIZE)), "an edge is drawn, and not a slope"
    assert np.interp(on + lasted / 2, curve.driver, curve.change) == pytest.approx(SIZE, rel=0.1)


def test_both_edges_of_a_pulse_may_lie_where_the_record_is_suspect() -> None:
    pulse = Effect("froth_recovery", "time", PULSE, {"amplitude": -0.2, "on_1": 1000.0, "for_1": 300.0})
    assert event_times(pulse) == ((1000.0, 1000.0), (1300.0, 1300.0))
    assert suspect_notes([pulse], [Suspect(1290.0, 1310.0, "a hole")], 10.0)
    assert not suspect_notes([pulse], [Suspect(1100.0, 1200.0, "a hole")], 10.0)


def test_a_pulse_is_no_drift_and_has_no_freer_form() -> None:
    pulse = Effect("froth_recovery", "time", PULSE, {"amplitude": -0.2, "on_1": 1000.0, "for_1": 3000.0})
    assert not slow(pulse)
    assert freer(pulse, 0.0, 9000.0) is None
    scorer = scored(with_a_pulse())
    assert step_score(scorer.scores()[0], pulse, 1e6) is None
