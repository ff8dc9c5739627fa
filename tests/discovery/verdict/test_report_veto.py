"""Protects: what held-out rows contradict is never told as a name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from adaptive_flot.discovery.record.background import Background
from adaptive_flot.discovery.results import Alternative, Discovery, Judgement, OutputChange
from adaptive_flot.discovery.verdict import heed_report as stage
from adaptive_flot.discovery.verdict.heed_report import with_memory
from adaptive_flot.discovery.verdict.report_veto import (
    contradiction,
    contradiction_at_the_end,
    explains_little,
    last_report_rows,
    noise_from_row_to_row,
    rests_on_memory,
    unexplained,
    without_gain,
)
from adaptive_flot.greybox import Effect
from tests.discovery.heated import heated_tank
from tests.discovery.verdict.states import state_of

NOISE = np.array([0.1])


def _change(before: float, after: float, low: float, high: float) -> OutputChange:
    return OutputChange("temperature", "K", before, after, 0.1, (low, high))


def _judged(draught: Discovery, word: str = "named", driver: str = "fan_speed") -> Judgement:
    assert draught.search is not None
    own = draught.search.alternatives[0]
    best = Alternative((("heat_loss", driver),), (True,), own.fit, 0.0, -100.0)
    return Judgement(word, best, (), (), 10.0)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (_change(2.43, 8.96, -5.94, 0.62), "larger"),  # the opened box: a wide interval does not excuse it
        (_change(2.0, 2.1, -0.08, -0.02), "larger"),  # a little worse, but surely
        (_change(2.0, 2.1, -0.08, 0.02), "no output surely"),
        (_change(2.0, 1.0, 0.3, 0.6), ""),
        (_change(2.0, 1.9, -0.1, 0.2), "no output surely"),
        (_change(2.0, 1.999, 1e-5, 1e-3), "no output surely"),  # certain, and nothing that a user would see
    ],
)
def test_a_name_is_contradicted(draught: Discovery, change: OutputChange, said: str) -> None:
    """The first case is the one that was measured: named, while the error on the report split grew fourfold."""
    against = contradiction(_judged(draught), [change], NOISE)
    assert said in against and bool(said) == bool(against)
    if said:
        assert f"{change.before:.3g} -> {change.after:.3g} K" in against


@pytest.mark.parametrize(
    ("change", "contradicts"),
    [
        (_change(2.0, 2.8, -2.0, 0.2), False),  # two fifths, and not surely
        (_change(2.0, 2.8, -2.0, -0.2), True),
        (_change(2.43, 8.96, -5.94, 0.62), True),  # the opened box: on few rows too
    ],
)
def test_on_the_few_rows_of_an_event_an_error_must_surely_be_larger_or_by_half(
    draught: Discovery, change: OutputChange, contradicts: bool
) -> None:
    better, noise = _change(2.0, 1.0, 0.3, 0.6), np.array([0.1, 0.1])
    assert bool(contradiction(_judged(draught), [better, change], noise, few=True)) == contradicts
    assert contradiction(_judged(draught), [better, change], noise)


def test_an_output_at_its_noise_contradicts_nothing(draught: Discovery) -> None:
    """Two outputs: one gets much better, the other wanders by a fifth within its noise."""
    other = OutputChange("flow", "m3/s", 0.10, 0.12, 0.1, (-0.3, -0.1))
    better = _change(2.0, 1.0, 0.3, 0.6)
    assert contradiction(_judged(draught), [better, other], np.array([0.1, 0.1])) == ""
    assert "flow" in contradiction(_judged(draught), [better, other], np.array([0.1, 0.01]))


@pytest.mark.parametrize("word", ["none", "abstain", "unnamed", "insufficient"])
def test_only_names_are_taken_back(draught: Discovery, word: str) -> None:
    """A verdict that gives no name has nothing to take back."""
    assert contradiction(_judged(draught, word), [_change(2.0, 9.0, -4.0, -3.0)], NOISE) == ""


@pytest.mark.parametrize(("site", "taken"), [("thermometer", True), ("heat_loss", False)])
def test_a_curve_in_time_at_a_sensor_must_hold_beyond_what_it_was_fitted_to(
    draught: Discovery, site: str, taken: bool
) -> None:
    """Only a sensor is asked to: its free curve can mimic any residual."""
    judged = _judged(draught)
    assert judged.best is not None
    curve = Effect(site, "time", "curve", {}, {"knots": (0.0, 5000.0, 10000.0)})
    fit = replace(judged.best.fit, model=heated_tank().with_effects([curve]))
    judged = replace(judged, best=replace(judged.best, names=((site, "time"),), fit=fit))
    worse = [_change(2.0, 4.0, -2.0, 0.5)]
    assert bool(contradiction_at_the_end(judged, worse, NOISE)) == taken
    assert bool(contradiction_at_the_end(judged, worse, NOISE, np.array([1.0]))) == taken
    assert not contradiction_at_the_end(judged, worse, NOISE, np.array([4.0]))  # the course of a feed, out there


def test_noise_with_a_memory_is_more_than_its_differences_show(draught: Discovery) -> None:
    """Neighbours with a correlation of 0.7 show 55 % of it. Without a background this may be what is missing."""
    rng = np.random.default_rng(1)
    noise = lfilter([np.sqrt(1 - 0.7**2)], [1, -0.7], rng.standard_normal(20000))
    shown = np.array([np.std(np.diff(noise)) / np.sqrt(2)])
    assert shown[0] == pytest.approx(np.sqrt(0.3), rel=0.03)
    assert draught.problem is not None
    error = [replace(_change(1.0, 1.03, -0.05, -0.01), noise=float(np.std(noise)))]
    assert with_memory(draught.problem, error, shown) == shown
    responses = np.zeros((*draught.problem.measured.shape, 1))
    beside = replace(draught.problem, background=Background(None, 0.02, responses))
    assert with_memory(beside, error, shown) == pytest.approx(1.0, rel=0.05)
    better = OutputChange("flow", "m3/s", 2.0, 1.0, 0.1, (0.3, 0.6))
    said = contradiction(_judged(draught), [better, *error], np.array([0.1, float(shown[0])]))
    assert "temperature" in said
    assert not contradiction(_judged(draught), [better, *error], np.array([0.1, float(np.std(noise))]))


def test_the_last_report_rows_are_the_last_contiguous_ones(draught: Discovery) -> None:
    """They end where the split ends, and nothing of the other splits is touched."""
    assert draught.problem is not None
    last = last_report_rows(draught.problem)
    rows, all_rows = (np.flatnonzero(p.rows("report")) for p in (last, draught.problem))
    assert rows[-1] == all_rows[-1] and (np.diff(rows) == 1).all() and len(rows) < len(all_rows)
    assert (last.rows("estimate") == draught.problem.rows("estimate")).all()


def test_the_stage_turns_a_contradicted_name_into_an_abstention(draught: Discovery) -> None:
    """With before and after exchanged, the same record contradicts the same name; as they are it does not."""
    assert draught.problem is not None and draught.before is not None and draught.after is not None
    state = state_of(draught, _judged(draught))
    assert stage.heed_report(state).judged.word == "named"
    exchanged = stage.heed_report(replace(state, before=draught.after, after=draught.before))
    assert exchanged.judged.word == "abstain" and "larger" in exchanged.contradiction


def test_noise_that_grows_with_the_value_counts_as_it_is_on_the_report_rows(draught: Discovery) -> None:
    """The median of the differences is that of the many small values; the error is that of the few large ones."""
    assert draught.problem is not None and draught.before is not None
    problem, model, rng = draught.problem, draught.before.model, np.random.default_rng(5)
    weights = np.where(np.arange(len(problem.record)) % 40 < 32, 0.05, 2.2)[:, None]
    noise = 0.3 * weights * rng.standard_normal((len(problem.record), 1))
    outputs = problem.record.outputs.copy()
    outputs[:, problem.columns] = 20.0 * weights + noise
    grown = replace(problem, record=replace(problem.record, outputs=outputs), weights=weights)
    change = replace(_change(1.0, 1.0, 0.0, 0.0), output=model.outputs[problem.columns[0]].name)
    found = noise_from_row_to_row(grown, model, [change])
    report = problem.rows("report")
    assert found == pytest.approx(np.sqrt(np.mean(noise[report] ** 2)), rel=0.25)
    constant = noise_from_row_to_row(replace(grown, weights=np.ones_like(weights)), model, [change])
    assert constant < 0.2 * found


def test_none_asks_for_a_residual_at_the_level_of_a_noise_that_no_model_has_fitted() -> None:
    """A box whose free run was off by 54 times its noise was told to be explained."""
    far, near = _change(5.77, 5.4, 0.0, 0.1), _change(0.2, 0.2, 0.0, 0.1)
    assert "5.4 K (54 times)" in unexplained([far], NOISE)
    assert unexplained([near], NOISE) == "" == unexplained([far], np.array([0.0]))


def test_none_says_that_it_rests_on_noise_with_a_memory_where_errors_are_well_above_that_from_row_to_row() -> None:
    """A cell whose cooling had failed was said to be explained, beside an error of 2.7 times its noise."""
    assert "0.3 K (3 times)" in rests_on_memory([_change(0.3, 0.3, 0.0, 0.1)], NOISE)
    assert rests_on_memory([_change(0.19, 0.19, 0.0, 0.1)], NOISE) == ""


def test_what_leaves_nearly_all_of_a_large_error_is_no_name() -> None:
    """Measured: the slip of the gas was named for a bubble size. It removed 7 % of the error and left 40 noises."""
    noise = np.array([0.1, 0.1])
    little, hardly = _change(0.7, 0.56, 0.1, 0.3), replace(_change(4.0, 3.95, -0.01, 0.1), output="flow")
    said = explains_little([little, hardly], noise)
    assert "removes only 3 % of the squared error" in said
    assert "flow 3.95 K (40 times)" in said
    assert not explains_little([little, replace(hardly, after=2.0)], noise)  # most of the error is gone
    assert not explains_little([_change(0.4, 0.39, 0.01, 0.1)], noise[:1])  # little is left
    assert not explains_little([little, hardly], np.array([0.1, 0.9]))  # what is left is noise, or a feed


def test_the_stage_turns_a_none_that_explains_nothing_into_an_abstention(draught: Discovery) -> None:
    """The plain model of a tank in a draught leaves ten times its noise; the extended one nothing but noise."""
    assert draught.problem is not None and draught.before is not None and draught.after is not None
    nothing = Judgement("none", None, (), (), 10.0)
    state = state_of(draught, nothing, draught.before)
    left = stage.heed_report(state)
    assert left.judged.word == "abstain" and "times)" in left.certain and "nearest" not in left.certain
    assert stage.heed_report(replace(state, after=draught.after)).judged.word == "none"


def test_an_abstention_says_which_drift_took_up_most_of_the_error(
    draught: Discovery, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A drive whose friction grew at 7 s: no effect explained it, it said, beside an error ten times smaller."""
    assert draught.problem is not None and draught.before is not None and draught.after is not None
    monkeypatch.setattr(stage, "unexplained", lambda changes, noise: "The error is far above the noise.")
    drifting = Judgement("none", _judged(draught).best, (), (), 10.0)
    state = state_of(draught, drifting)
    left = stage.heed_report(state)
    assert left.judged.word == "abstain"
    assert "What comes nearest is a change of what is fitted: heat loss, in time." in left.certain
    assert drifting.best is not None
    as_near = replace(drifting.best, names=(("heat_loss", "fan_speed"),))
    said = stage.heed_report(state_of(draught, replace(drifting, rivals=(as_near,)))).certain
    assert "heat loss, in time, or as it depends on fan speed." in said
    assert "nearest" not in stage.heed_report(replace(state, after=draught.before, before=draught.after)).certain


def test_effects_that_were_looked_for_at_once_improve_each_output_that_stays_wrong() -> None:
    """An oxygen demand that nobody measured came in spells; a joint search told laws of other signals for certain."""
    noise = np.array([0.03, 0.08])
    oxygen, ammonium = _change(0.551, 0.447, -0.62, 0.46), _change(0.694, 0.148, 0.74, 0.82)
    assert "0.551 -> 0.447" in without_gain([oxygen, ammonium], noise)
    assert not without_gain([oxygen, ammonium], np.array([0.3, 0.08]))  # what is left is near the noise
    assert not without_gain([replace(oxygen, reduction95=(0.02, 0.46)), ammonium], noise)
    assert not without_gain([replace(oxygen, before=0.05), ammonium], noise)  # it was not wrong before


def test_only_effects_that_were_looked_for_at_once_are_asked_that(
    draught: Discovery, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = state_of(draught, _judged(draught))
    monkeypatch.setattr(stage, "without_gain", lambda error, noise: "nothing is gained")
    assert stage.heed_report(state).judged.word == "named"
    assert state.problem is not None
    jointly = stage.heed_report(replace(state, problem=replace(state.problem, whiten=False)))
    assert jointly.judged.word == "abstain" and jointly.contradiction == "nothing is gained"
