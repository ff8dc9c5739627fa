"""Discovery in the loop: the watch starts a search, and what it names extends the running model without a bump."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.contracts import Setup
from adaptive_flot.contracts.batch import BatchFit
from adaptive_flot.discovery.record.screening import Screening
from adaptive_flot.discovery.results import Discovery, Verdict, Word
from adaptive_flot.errors import AdaptiveFlotError, ModelError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.plugins import DEFAULT_ESTIMATOR
from adaptive_flot.runner.adaptation import search, supervisor
from adaptive_flot.runner.adaptation.extension import Extension
from adaptive_flot.runner.adaptation.search import Finding, search_record
from adaptive_flot.runner.adaptation.whiteness_watch import Alarm
from adaptive_flot.runner.commands.fingerprint import conditions
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from tests.runner.conftest import WriteScenario

GROWTH = {
    "site": "bubble_size",
    "driver": "air_flow",
    "form": "power",
    "coefficients": {"exponent": 0.6},
    "settings": {"reference": {"value": 1.5e-3, "unit": "m3/s"}},
}
OPTIONS = {"window_s": 50, "least_record_s": 50, "delay_s": 10, "false_alarm": 0.01, "pause_s": 0}
WATCHED: dict[str, Any] = {"discovery": OPTIONS, "seeds": [1]}
CLOSED: dict[str, Any] = {
    "controllers": {"economic_mpc": {"use": "economic_mpc", "options": {"solver": "fatrop", "horizon": 4}}},
    "limits": {
        "concentrate_grade": 0.2,
        "level_m": [0.33, 0.42],
        "inputs": {"air_flow_m3_s": [9.05e-4, 2.17e-3], "level_setpoint_m": [0.33, 0.42]},
        "largest_move": {"air_flow_m3_s": 2e-4, "level_setpoint_m": 0.01},
    },
    "economics": {},
}
Stub = Callable[..., Discovery]


def growth(exponent: float) -> Effect:
    return Effect("bubble_size", "air_flow", "power", {"exponent": exponent}, {"reference": 1.5e-3})


LATE_FEED = Effect(
    "feed_flow", "delay", "delay", {"amplitude": 0.0, "dead_time": 20.0}, {"scale": 1.67e-4, "stages": 3}
)


def says(word: Word, *effects: Effect, **parameters: float) -> Stub:
    """A discovery with a given end."""

    def discover(model: Model, record: Dataset, *, adapted: tuple[str, ...], processes: int) -> Discovery:
        del adapted, processes
        found = model.with_parameters(parameters).with_effects(effects)
        return Discovery(Verdict(word, f"stub: {word}"), found, Screening(record, (), ()))

    return discover


def runs(path: Path, estimator: str) -> list[Run]:
    return run_scenario(load_scenario(path), [estimator], [1])


@pytest.fixture
def alarming(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every window alarms."""
    monkeypatch.setattr(supervisor, "watch", lambda innovations, level: Alarm({f"{next(iter(innovations))} mean": 0.0}))


def same(one: Run, two: Run) -> None:
    clock = ["solve_seconds"]
    left, right = (r.table.drop(columns=clock, errors="ignore") for r in (one, two))
    pd.testing.assert_frame_equal(left, right, check_exact=True)


@pytest.mark.parametrize(
    ("estimator", "effects", "more"),
    [
        ("rpem", (growth(0.0),), CLOSED),
        ("rpem", (growth(0.0), LATE_FEED), {}),
        ("ekf", (LATE_FEED,), {}),
        ("fixed", (LATE_FEED,), {}),
        (DEFAULT_ESTIMATOR, (LATE_FEED,), {}),
    ],
    ids=["rpem, closed loop", "rpem, states", "ekf, states", "fixed, states", "default, states"],
)
def test_an_effect_of_size_zero_changes_nothing(
    write_scenario: WriteScenario,
    monkeypatch: pytest.MonkeyPatch,
    alarming: None,
    estimator: str,
    effects: tuple[Effect, ...],
    more: dict[str, Any],
) -> None:
    """Estimates, decisions and predictions after the model was extended are those of the run without, to the bit."""
    watched, unwatched = with_and_without(write_scenario, monkeypatch, estimator, effects, more)
    assert watched.inquiries is not None and [i.extended for i in watched.inquiries] == [True]
    assert unwatched.inquiries is None
    same(watched, unwatched)


def test_an_extended_model_is_judged_anew(
    write_scenario: WriteScenario, monkeypatch: pytest.MonkeyPatch, alarming: None
) -> None:
    """Errors of the first record that are not white rule out the model of the fit, not the one that was found."""
    prior = BatchFit.prior
    coloured = np.array([30.0])
    monkeypatch.setattr(BatchFit, "prior", lambda self, time: replace(prior(self, time), colour=coloured))
    still: dict[str, Any] = {"parameters": {}}
    watched, unwatched = with_and_without(write_scenario, monkeypatch, DEFAULT_ESTIMATOR, (LATE_FEED,), still)
    assert watched.inquiries and watched.inquiries[0].extended
    since = watched.inquiries[0].judged_s + 1
    late, same_time = (set(run.table["status"][run.table["time_s"] > since]) for run in (watched, unwatched))
    assert "model_error" not in late and same_time == {"model_error"}


def test_further_states_of_no_effect_do_not_bump_the_inputs(
    write_scenario: WriteScenario, monkeypatch: pytest.MonkeyPatch, alarming: None
) -> None:
    """The optimal control problem has more variables then, so its solution is the same to the solver's tolerance only;
    the plan before is its start."""
    watched, unwatched = with_and_without(write_scenario, monkeypatch, "rpem", (LATE_FEED,), CLOSED)
    assert watched.inquiries and watched.inquiries[0].extended
    for column in ("air_flow_m3_s", "level_setpoint_m"):
        np.testing.assert_allclose(watched.table[column], unwatched.table[column], rtol=1e-4)
    assert set(watched.table["control_status"]) == {"ok"}


def with_and_without(
    write: WriteScenario,
    monkeypatch: pytest.MonkeyPatch,
    estimator: str,
    effects: tuple[Effect, ...],
    more: dict[str, Any],
) -> tuple[Run, Run]:
    """The run whose model is extended by the effects, all else kept, and the run that nobody watches."""
    plain = {"seeds": [1], "estimators": {estimator: {"use": estimator}}, **more}
    keep = Finding(Verdict("named", "stub"), Extension(effects))
    monkeypatch.setattr(supervisor, "search_record", lambda setup, record, processes: keep)
    (watched,) = runs(write({**plain, "discovery": OPTIONS}), estimator)
    (unwatched,) = runs(write(plain), estimator)
    return watched, unwatched


@pytest.mark.parametrize("fitted", [True, False], ids=["state fitted", "state carried over"])
def test_a_named_effect_lowers_the_error(
    write_scenario: WriteScenario, monkeypatch: pytest.MonkeyPatch, fitted: bool
) -> None:
    """Bubbles grow with air and the model does not know. Named with its size the effect lowers the error, and with the
    state of the record nothing is left of it; the alarm is the watch's own, and nothing is rewritten."""
    changes: dict[str, Any] = {"seeds": [1], "plant": {"effects": [GROWTH]}, "parameters": {}}
    scenario = load_scenario(write_scenario(changes))
    start = steady_state(scenario.plant_model, Realisation(scenario, 1).schedule[0]).state
    truth = Extension((growth(0.6),), {}, start if fitted else None)
    finding = Finding(Verdict("named", "stub"), truth)
    monkeypatch.setattr(supervisor, "search_record", lambda setup, record, processes: finding)
    (watched,) = runs(write_scenario({**changes, "discovery": OPTIONS}), "fixed")
    (unwatched,) = runs(write_scenario(changes), "fixed")
    assert watched.inquiries is not None
    inquiry = watched.inquiries[0]
    assert (inquiry.alarm_s, inquiry.record_s, inquiry.judged_s) == (90.0, (1.0, 90.0), 100.0)
    assert inquiry.extended

    def error(run: Run) -> float:
        late = run.table[run.table["time_s"] > inquiry.judged_s]
        return float(np.abs(late["concentrate_grade_true"] - late["concentrate_grade_predicted"]).max())

    assert error(watched) < (1e-9 if fitted else error(unwatched))
    early = watched.table["time_s"] <= inquiry.judged_s
    pd.testing.assert_frame_equal(watched.table[early], unwatched.table[early], check_exact=True)


def test_what_a_search_found_becomes_an_extension(model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fitted effect, fitted values of the adapted parameters by name, and the fitted state; effects that the model has
    already are not added again."""
    base = model.with_effects([Effect("grade_sensor", "constant", "shift", {"amplitude": 0.01})])
    record = Dataset("r", np.arange(3.0), 1.0, np.zeros((3, 3)), np.zeros((3, len(model.outputs))))
    state = np.arange(float(len(model.states)))

    def discover(model: Model, record: Dataset, **options: object) -> Discovery:
        found = says("class", growth(0.3), growth_exponent=1.07)(model, record, **options)
        return replace(found, after=cast(Any, SimpleNamespace(initial_state=state)))

    monkeypatch.setattr(search, "discover", discover)
    found = search_record(Setup(base, 1.0, ("growth_exponent", "coalescence_rate"), ("concentrate_grade",)), record, 1)
    assert found.extension.effects == (replace(growth(0.3), coefficients={"amplitude": 0.0, "exponent": 0.3}),)
    assert found.extension.parameters == {"growth_exponent": 1.07, "coalescence_rate": 6.38e-4}
    assert found.extension.initial_state is state
    assert found.extension.model(base).names("parameters") == base.with_effects([growth(0.3)]).names("parameters")


def test_the_inputs_keep_their_rate_limit(
    write_scenario: WriteScenario, monkeypatch: pytest.MonkeyPatch, alarming: None
) -> None:
    """A large effect is taken up while the controller works: no input moves further than it may, at any sample."""
    changes = {**WATCHED, **CLOSED, "plant": {"effects": [GROWTH]}, "parameters": {}}
    monkeypatch.setattr(search, "discover", says("named", growth(0.6)))
    (run,) = runs(write_scenario(changes), "fixed")
    assert run.inquiries and run.inquiries[0].extended
    table = run.table[run.table["time_s"] >= 41]
    for column, limit in CLOSED["limits"]["largest_move"].items():
        assert np.abs(np.diff(table[column])).max() <= limit * 1.001
    assert set(table["control_status"]) == {"ok"}


@pytest.mark.parametrize("word", ["none", "abstain", "insufficient", "unnamed"])
def test_other_verdicts_leave_the_loop_alone(
    write_scenario: WriteScenario, monkeypatch: pytest.MonkeyPatch, alarming: None, word: Word
) -> None:
    monkeypatch.setattr(search, "discover", says(word, growth(0.6)))
    (watched,) = runs(write_scenario(WATCHED), "rpem")
    (unwatched,) = runs(write_scenario({"seeds": [1]}), "rpem")
    assert watched.inquiries is not None
    assert [(i.extended, i.why) for i in watched.inquiries] == [(False, f"the verdict is '{word}'")]
    same(watched, unwatched)


def test_a_failed_search_leaves_the_loop_alone(
    write_scenario: WriteScenario, monkeypatch: pytest.MonkeyPatch, alarming: None
) -> None:
    def fails(*args: object, **options: object) -> Discovery:
        raise ModelError("nothing to search")

    monkeypatch.setattr(search, "discover", fails)
    (watched,) = runs(write_scenario(WATCHED), "rpem")
    (unwatched,) = runs(write_scenario({"seeds": [1]}), "rpem")
    assert watched.inquiries is not None
    assert [(i.verdict, i.extended, i.why) for i in watched.inquiries] == [(None, False, "nothing to search")]
    same(watched, unwatched)


def test_a_wrong_name_is_refused_by_rows_that_chose_nothing(
    write_scenario: WriteScenario, monkeypatch: pytest.MonkeyPatch, alarming: None
) -> None:
    """The plant has no effect; a search that claims a strong one is not believed."""
    monkeypatch.setattr(search, "discover", says("named", growth(2.0)))
    (run,) = runs(write_scenario({**WATCHED, "parameters": {}}), "fixed")
    assert run.inquiries is not None
    (inquiry,) = run.inquiries
    assert not inquiry.extended and inquiry.why.startswith("the one-step error of concentrate_grade grows")


def test_a_search_sees_what_was_measured_and_no_more(
    write_scenario: WriteScenario, monkeypatch: pytest.MonkeyPatch, alarming: None, tmp_path: Path
) -> None:
    """The record of the search is the measured part of the run's table: known inputs, measured outputs, no parameters
    and no state of the plant; the model it is given is the controller's."""

    def look(model: Model, record: Dataset, *, adapted: tuple[str, ...], processes: int) -> Discovery:
        assert not record.parameters and record.initial_state is None and not model.effects
        np.savez(tmp_path / "seen.npz", time=record.time, inputs=record.inputs, outputs=record.outputs)
        return says("none")(model, record, adapted=adapted, processes=processes)

    monkeypatch.setattr(search, "discover", look)
    changes = {**WATCHED, "plant": {"effects": [GROWTH]}, "discovery": {**OPTIONS, "record_s": 70}}
    (run,) = runs(write_scenario(changes), "rpem")
    seen = np.load(tmp_path / "seen.npz")
    assert seen["time"].tolist() == list(range(21, 91))
    table = run.table[run.table["time_s"].between(21, 90)]
    model = load_scenario(write_scenario(changes)).model
    np.testing.assert_array_equal(seen["inputs"], table[[q.column for q in model.inputs]])
    for j, q in enumerate(model.outputs):
        measured = table.get(f"{q.column}_measured")
        np.testing.assert_array_equal(seen["outputs"][:, j], np.nan if measured is None else measured)


def test_the_key_is_method_and_does_not_part_results(write_scenario: WriteScenario) -> None:
    """Runs with and without discovery are compared: the plant and what is asked of it are the same."""
    assert conditions(load_scenario(write_scenario(WATCHED))) == conditions(load_scenario(write_scenario()))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"discovery.windw_s": 60}, "unknown key 'discovery.windw_s'; did you mean 'window_s'"),
        ({"discovery.false_alarm": 0.0}, "discovery.false_alarm"),
        ({"discovery.processes": 0}, "discovery.processes"),
        ({"discovery.estimators": ["rpm"]}, "discovery.estimators: 'rpm' is not defined; did you mean 'rpem'"),
        ({"discovery.outputs": ["levl"]}, "discovery.outputs: 'levl' is not measured; did you mean 'level'"),
        ({"discovery.window_s": 40}, "window_s = 40 s holds too few samples; give 50 s or more"),
        ({"discovery.record_s": 40}, "least_record_s = 50 s is longer than record_s = 40 s"),
        ({"discovery.delay_s": 80}, "least_record_s . delay_s = 130 s, longer than the run, 120 s"),
        ({"estimators": {"oracle": {"use": "oracle"}}}, "no estimator to watch"),
        ({"estimators.o": {"use": "oracle"}, "discovery.estimators": ["o"]}, "'o' is shown the truth"),
    ],
)
def test_a_wrong_key_is_one_line(write_scenario: WriteScenario, changes: dict[str, Any], says: str) -> None:
    path = write_scenario({"discovery": dict(OPTIONS), "seeds": [1], **changes})
    with pytest.raises(AdaptiveFlotError, match=says) as error:
        load_scenario(path)
    assert str(error.value).startswith(str(path)) and "\n" not in str(error.value)
