"""Whole discoveries: the truth of a tank made apart is found, nothing is found where nothing is, and a drift is one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.results import Discovery, State, Verdict
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.stepping.record import RecordSimulator
from tests.discovery.heated import DT, Truth, heated_tank, moves, tank_record


def names(found: Discovery) -> list[tuple[str, str]]:
    return [(e.effect.site, e.effect.driver) for e in found.verdict.effects]


def test_a_draught_is_named_with_its_exponent_and_its_error_before_and_after(draught: Discovery) -> None:
    assert draught.verdict.word == "named" and names(draught) == [("heat_loss", "fan_speed")]
    effect = draught.verdict.effects[0]
    low, high = effect.interval95["exponent"]
    assert low < 0.6 < high and high - low < 0.1
    (change,) = draught.verdict.error
    assert change.after < 1.3 * 0.05 < 0.3 < change.before


def test_the_extended_model_predicts_a_record_that_nobody_has_seen(draught: Discovery) -> None:
    fresh = tank_record(Truth(noise=0.0), seed=9)
    assert draught.before is not None and draught.problem is not None

    def error(model_of: Discovery, extended: bool) -> float:
        model = model_of.model if extended else model_of.before.model  # type: ignore[union-attr]
        free = RecordSimulator(model, DT).outputs(fresh, np.array([305.0]), model.parameter_values)
        return float(np.sqrt(np.mean((free - fresh.outputs)[50:] ** 2)))

    assert error(draught, True) < 0.15 * error(draught, False)


def test_a_stage_that_gives_a_verdict_ends_the_procedure(monkeypatch: pytest.MonkeyPatch, draught: Discovery) -> None:
    """Nothing that comes after it is run, and what was known before it is kept."""

    def late(state: State) -> State:
        raise AssertionError("a stage after the verdict was run")

    assert draught.problem is not None
    stages = (lambda state: replace(state, problem=draught.problem), lambda state: Verdict("abstain", "so"), late)
    monkeypatch.setattr("adaptive_flot.discovery.discover.STAGES", stages)
    model = heated_tank()
    ended = discover(model, tank_record(Truth()))
    assert (ended.verdict.word, ended.problem, ended.model) == ("abstain", draught.problem, model)


def test_linear_algebra_takes_one_thread_and_gives_the_others_back() -> None:
    """Sums in one order on every machine: seen by the progress callback, with two threads allowed outside."""

    def threads(stage: str = "") -> None:
        seen.append((stage, {d["num_threads"] for d in threadpool_info() if d["user_api"] == "blas"}))

    seen: list[tuple[str, set[int]]] = []
    with threadpool_limits(limits=2, user_api="blas"):
        discover(heated_tank(), tank_record(Truth(exponent=0.0)), progress=threads)
        assert len(seen) > 3 and all(count == {1} for _, count in seen)
        threads()
    assert seen[-1] == ("", {2})


@pytest.mark.parametrize("seed", range(5))
def test_nothing_is_found_where_nothing_is_missing(seed: int) -> None:
    verdict = discover(heated_tank(), tank_record(Truth(exponent=0.0), seed=seed)).verdict
    assert verdict.word == "none" and verdict.effects == () and verdict.experiment is None


@pytest.mark.parametrize(
    ("truth", "name"),
    [
        (Truth(exponent=0.0, loss_step=0.2), ("heat_loss", "time")),
        (Truth(exponent=0.0, offset=0.5), ("thermometer", "time")),
    ],
)
def test_an_event_is_named_by_where_it_acts(truth: Truth, name: tuple[str, str]) -> None:
    found = discover(heated_tank(), tank_record(truth))
    assert found.verdict.word == "named" and names(found) == [name]
    onset = found.verdict.effects[0].effect.coefficients["onset"]
    assert onset == pytest.approx(300 * DT, abs=20 * DT)


@pytest.mark.parametrize(("drifts", "word"), [(True, "none"), (False, "abstain")])
def test_a_slow_drift_of_an_adapted_parameter_is_no_missing_effect(drifts: bool, word: str) -> None:
    """The loss grows by a third over the record: tracking that is the estimator's work.

    Where the model does not say that its constants drift, so large a one is no `none`: it is where to look.
    """
    inputs = np.column_stack([moves(600, 500, 3000, 40, 1), moves(600, 5, 20, 25, 2)])
    temperature, seen = 305.0, []
    for k, (power, _) in enumerate(inputs):
        loss = 60.0 * (1 + k / 1800)
        for _ in range(10):
            temperature += DT / 10 * (0.9 * power - loss * (temperature - 293.0)) / 4.0e5
        seen.append(temperature)
    y = np.array(seen) + 0.05 * np.random.default_rng(3).standard_normal(600)
    tank = heated_tank()
    tank = replace(tank, parameters=tuple(replace(p, drifts=drifts) for p in tank.parameters))
    verdict = discover(tank, Dataset("drift", DT * np.arange(1.0, 601), DT, inputs, y[:, None])).verdict
    assert verdict.word == word and verdict.effects == ()
    assert any("heat_loss" in d for d in verdict.drift) == drifts
    assert "heat loss changes by about" in verdict.reason.lower()
    assert drifts or verdict.reason.startswith("Something changes with time.")


def test_a_pump_that_is_off_now_and_then_divides_nothing_by_zero() -> None:
    inputs = tank_record().inputs.copy()
    inputs[100:160, 0] = 0.0
    found = discover(heated_tank(), tank_record(inputs=inputs))
    assert found.verdict.word == "named" and names(found) == [("heat_loss", "fan_speed")]


def test_a_short_record_with_a_large_effect_is_judged() -> None:
    found = discover(heated_tank(), tank_record(rows=300))
    assert names(found) == [("heat_loss", "fan_speed")]


def test_two_processes_find_what_one_finds(draught: Discovery) -> None:
    twice = discover(heated_tank(), tank_record(), processes=2)
    assert twice.verdict.as_dict() | {"seconds": 0} == draught.verdict.as_dict() | {"seconds": 0}


def test_what_was_found_is_not_found_again(draught: Discovery) -> None:
    """Discovery on the extended model and a fresh record: nothing is missing."""
    verdict = discover(draught.model, tank_record(seed=5)).verdict
    assert verdict.word == "none", verdict


def test_a_record_of_its_own_reports_and_may_only_take_a_name_back(draught: Discovery) -> None:
    """The error is that of the other record. What is fitted does not depend on it, but it has a veto."""
    other = tank_record(seed=7)
    a = discover(heated_tank(), tank_record(), report_record=other)
    spoilt = Dataset("spoilt", other.time, other.dt, other.inputs, other.outputs + 5.0)
    b = discover(heated_tank(), tank_record(), report_record=spoilt)
    assert a.after is not None and b.after is not None and a.after.values.tolist() == b.after.values.tolist()
    assert (a.verdict.word, b.verdict.word, b.verdict.effects) == ("named", "abstain", ())
    assert a.verdict.error[0].after < 0.1 < 4.0 < b.verdict.error[0].after


def test_a_model_without_sites_or_with_an_unknown_parameter_is_refused(clock: object) -> None:
    with pytest.raises(ModelError, match="no sites"):
        discover(clock, tank_record())  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="efficiency"):
        discover(heated_tank(), tank_record(), adapted=["eficiency"])


def test_a_model_without_adapted_parameters_can_be_judged() -> None:
    """A user's first model: no parameter is of role "estimated"."""
    tank = heated_tank()
    fixed = replace(tank, parameters=tuple(replace(p, role="fixed") for p in tank.parameters))
    found = discover(fixed, tank_record(Truth(exponent=0.0)))
    assert found.verdict.word in ("none", "named", "class", "unnamed", "abstain") and found.verdict.parameters == {}
