"""Protects: since a reference, effects of other shapes are found in long records; and what the reference lacks too has
not changed."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.procedure import Comparison, compare
from adaptive_flot.discovery.results import NamedEffect, OutputChange, Verdict
from adaptive_flot.discovery.since_reference import changes, searched_change
from adaptive_flot.discovery.since_reference.changes import find_changes
from adaptive_flot.discovery.since_reference.searched_change import (
    tells_more,
    with_constants_held,
    with_searched_effect,
)
from adaptive_flot.discovery.since_reference.taken_back import unless_more_than_noise
from adaptive_flot.discovery.verdict.words.wording import since_reference
from adaptive_flot.greybox import Effect
from tests.discovery.hypotheses.tank import record, tank

FOULS = Effect("heat_loss", "time", "ramp", {"amplitude": -0.4, "onset": 3000.0, "duration": 4000.0}, mode="factor")


# a loss that follows the power, which no single fault of the whole record is
FOLLOWS = Effect("heat_loss", "power", "linear", {"slope": 0.4}, {"reference": 1200.0}, mode="factor")


@pytest.fixture
def long_records(monkeypatch: pytest.MonkeyPatch) -> None:
    """Records are taken to be too long for the innovations form."""
    monkeypatch.setattr(changes, "is_short_since_reference", lambda *given: False)


@cache
def compared() -> Comparison:
    """A tank whose loss follows the power, beside one with a constant loss, judged by single faults, and not told."""
    found = compare(tank(), [record("new", 1, FOLLOWS)], [record("old", 2)])
    verdict = replace(found.verdict, word="abstain", effects=(), members=())
    return replace(found, verdict=verdict, judged=replace(found.judged, word="abstain"))


@pytest.mark.usefixtures("long_records")
def test_a_gradual_change_is_told_with_its_times_and_as_one_since_the_reference() -> None:
    verdict = find_changes(tank(), [record("new", 1, FOULS)], [record("old", 2)]).verdict
    assert verdict.word == "named", verdict.reason
    assert {(e.effect.site, e.effect.driver) for e in verdict.effects} == {("heat_loss", "time")}
    assert "has changed since the reference" in verdict.reason
    assert all(c.after < 1.5 * c.noise < c.before for c in verdict.error)
    assert any(note.startswith("By single faults of the whole record") for note in verdict.notes)
    assert not any("role 'estimated'" in note for note in verdict.notes)


@pytest.mark.usefixtures("long_records")
def test_a_budget_that_is_spent_leaves_the_search_out_and_says_so() -> None:
    verdict = find_changes(tank(), [record("new", 1, FOULS)], [record("old", 2)], budget=1e-6).verdict
    assert verdict.word == "abstain" and not verdict.effects and not verdict.members
    assert verdict.reason.startswith("Nothing is told: the budget ended before all ")


@pytest.mark.parametrize("short", [True, False])
def test_a_budget_that_ends_after_the_single_faults_leaves_them_and_says_so(
    monkeypatch: pytest.MonkeyPatch, short: bool
) -> None:
    """The innovations form of a short record has an end, too: a stiff reactor took minutes, whatever was asked."""
    ended = []

    def all_compared(*given: object, ends: float, **named: object) -> Comparison:
        ended.append(ends)
        found = replace(compared(), complete=True)
        while time.monotonic() < ends:
            time.sleep(0.01)
        return found

    monkeypatch.setattr(changes, "compare", all_compared)
    monkeypatch.setattr(changes, "is_short_since_reference", lambda *given: short)
    verdict = find_changes(tank(), [record("new", 1, FOLLOWS)], [record("old", 2)], budget=0.05).verdict
    assert len(ended) == 1 and np.isfinite(ended[0])
    assert verdict.word == "abstain" and changes.SPENT in verdict.notes
    # with the time to begin, and not to end: what the innovations form had come to is not told
    real, later = time.monotonic, [0.0]

    def time_is_up(stage: str) -> None:
        later[0] = 1e9 if stage == "what the reference lacks" else later[0]

    monkeypatch.setattr(changes, "compare", lambda *given, **named: compared())
    if short:
        # the real clock, until it is put forward: threads of other tests in this process read it too
        monkeypatch.setattr(time, "monotonic", lambda: real() + later[0])
        verdict = find_changes(
            tank(), [record("new", 1, FOLLOWS)], [record("old", 2)], budget=600.0, progress=time_is_up
        ).verdict
        assert later[0] > 0
        assert verdict.word == "abstain" and changes.SPENT in verdict.notes


@pytest.mark.parametrize("short", [True, False])
def test_a_name_that_process_noise_was_to_be_asked_about_is_not_told_without(
    monkeypatch: pytest.MonkeyPatch, short: bool
) -> None:
    """A long record is not searched row by row: there the free runs alone have always told."""
    named = replace(compared(), verdict=replace(compared().verdict, word="named"), complete=True)

    def in_time(*given: object, ends: float, **more: object) -> Comparison:
        while time.monotonic() < ends:
            time.sleep(0.01)
        return named

    monkeypatch.setattr(changes, "compare", in_time)
    monkeypatch.setattr(changes, "is_short_since_reference", lambda *given: short)
    monkeypatch.setattr(changes, "why_not_new", lambda *given: "")
    monkeypatch.setattr(changes, "unless_much_is_left", lambda compared: compared)
    verdict = find_changes(tank(), [record("new", 1, FOLLOWS)], [record("old", 2)], budget=0.05).verdict
    assert verdict.word == ("abstain" if short else "named") and changes.SPENT in verdict.notes
    assert (changes.NOT_ASKED in verdict.reason) == short


@pytest.mark.usefixtures("long_records")
def test_nothing_is_told_where_nothing_has_changed() -> None:
    assert find_changes(tank(), [record("new", 1)], [record("old", 2)]).verdict.word == "none"


def searched(before: Comparison) -> Comparison:
    """With what the search tells."""
    return with_searched_effect(before, before.rows.records[0], 1, lambda stage: None)


def test_a_dependence_is_told_as_new_where_the_reference_does_not_have_it() -> None:
    verdict = searched(compared()).verdict
    assert verdict.word in ("named", "class") and "since the reference" in verdict.reason, verdict.reason
    assert {e.effect.site for e in verdict.effects} == {"heat_loss"}


def test_errors_that_are_usual_on_the_reference_are_no_change() -> None:
    """The reference is said to err as much: the search finds the same effect, and it is not told."""
    before = compared()
    usual = replace(before.calibration.usual, rms=100.0 * before.calibration.usual.rms)
    found = replace(before, calibration=replace(before.calibration, usual=usual))
    assert searched(found) is found


def test_what_the_reference_lacks_too_is_not_told_as_a_change() -> None:
    """The reference is taken to be the record itself: the effect makes its errors there smaller as well."""
    before = compared()
    old = replace(before.calibration, rows=before.rows, fit=before.null.fit)
    found = replace(before, calibration=old)
    assert searched(found) is found


@pytest.mark.parametrize(
    ("said", "found", "more"),
    [
        ((1.0, 1.7, 1.1), (1.0, 1.0, 1.1), True),  # nothing is missing any more
        ((1.0, 1.7, 1.1), (1.0, 1.4, 1.1), False),  # hardly less
        ((1.0, 1.7, 1.1), (1.6, 1.0, 1.1), False),  # something else is missing now
        ((1.0, 1.4, 1.1), (1.0, 1.0, 1.1), False),  # nothing was
        ((2.0, 2.0, 2.0), (1.5, 1.5, 1.5), True),  # all are smaller
    ],
)
def test_what_is_told_gives_way_where_it_leaves_something_missing(
    said: tuple[float, ...], found: tuple[float, ...], more: bool
) -> None:
    """A gas slip that is 45 % larger left the tails at 1.7 times its usual error; one that follows the air left 1.0."""

    def verdict(left: tuple[float, ...]) -> Verdict:
        error = tuple(OutputChange(f"output {k}", "-", 9.0, after, 1.0, (0.5, 0.9)) for k, after in enumerate(left))
        return Verdict("named", "", error=error)

    assert tells_more(verdict(said), verdict(found)) is more


CURVE = Effect("heat_loss", "time", "curve", {"value_1": 0.0, "value_2": 0.3}, {"knots": (0.0, 9000.0)})
BY_WARMTH = Effect("heat_loss", "temperature", "curve", {"value_1": 0.0, "value_2": 0.3}, {"knots": (300.0, 320.0)})
BY_POWER = Effect("heater", "power", "curve", {"value_1": 0.0, "value_2": 0.3}, {"knots": (500.0, 3000.0)})


@pytest.mark.parametrize(
    ("effects", "left", "told"),
    [
        ((CURVE,), 1.3, True),
        ((CURVE,), 1.8, False),
        ((BY_WARMTH,), 1.8, True),
        ((BY_WARMTH, BY_POWER), 1.3, True),
        ((BY_WARMTH, BY_POWER), 1.8, False),
    ],
)
def test_a_curve_in_time_and_several_effects_are_told_only_where_they_leave_nothing(
    monkeypatch: pytest.MonkeyPatch, effects: tuple[Effect, ...], left: float, told: bool
) -> None:
    """A curve bends to what any cause has done: a burst rate that follows the solids was told as one that fell.

    Several effects stand in for a third thing: a load that swings on a robot's arm was its friction and its gear.
    """
    before = compared()
    c, usual = before.rows.columns[0], float(before.calibration.usual.overall[0])
    output = before.calibration.model.outputs[c]
    error = (OutputChange(output.name, output.unit, 9 * usual, left * usual, usual, (0.5, 0.9)),)
    grew = Verdict("named", "Loss grew.", tuple(NamedEffect(e, "", {}, ()) for e in effects), error=error)
    found = SimpleNamespace(verdict=grew, model=before.calibration.model.with_effects(effects))
    monkeypatch.setattr(searched_change, "discover", lambda *given, **named: found)
    monkeypatch.setattr(searched_change, "_worse_on_reference", lambda *given: np.inf)  # all are new
    assert (searched(before).verdict.word == "named") is told


@pytest.mark.parametrize(("memory", "word"), [(0.0, "named"), (0.8, "abstain")])
def test_noise_that_is_larger_than_on_the_reference_takes_no_name_back(memory: float, word: str) -> None:
    """A feed flow that was 8 % larger was taken back for a meter that is noisier where more flows."""
    before = compared()
    usual = before.calibration.usual.overall
    size = 3.0 * usual[0]
    white = np.random.default_rng(0).standard_normal((len(before.rows.records[0]) + 1, len(usual)))
    errors = size * (white[1:] + memory * white[:-1])
    output = before.calibration.model.outputs[before.rows.columns[0]]
    error = (OutputChange(output.name, output.unit, 9 * size, size, float(usual[0]), (0.5, 0.9)),)
    named = replace(before.verdict, word="named", error=error)
    judged = replace(before.judged, word="named", best=replace(before.null, fresh=(errors,)))
    found = unless_more_than_noise(replace(before, verdict=named, judged=judged))
    assert found.verdict.word == word, found.verdict.reason


def test_constants_of_the_reference_are_held() -> None:
    held = with_constants_held(tank(), ("loss",))
    assert [p.name for p in held.parameters if p.role == "estimated"] == ["efficiency"]


def test_words_say_whether_a_change_is_known_to_be_new() -> None:
    reason = "Loss fell. The model lacks this. Confirmed."
    assert since_reference(reason, True) == "Loss fell. This has changed since the reference. Confirmed."
    assert since_reference(reason, False) == "Loss fell. The reference does not show whether it was there. Confirmed."
    one = since_reference("The model lacks one of these, which this record can not tell apart: a; or b.", True)
    assert one.startswith("One of these, which")


@pytest.mark.usefixtures("long_records")
def test_a_name_that_leaves_more_than_noise_is_taken_back_where_the_model_is_right_on_its_reference(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Single faults call fouling a smaller loss; what the search would tell is left out."""
    monkeypatch.setattr(changes, "with_searched_effect", lambda compared, *given: compared)
    old = [record("old", 2)]
    first = compare(tank(), [record("new", 1, FOULS)], old).verdict
    found = find_changes(tank(), [record("new", 1, FOULS)], old).verdict
    assert first.error[0].after > 2 * first.error[0].noise
    assert found.word == "abstain" and found.effects == (), found.reason
