"""Runs of several seeds side by side are the runs of each seed alone."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pandas.testing import assert_frame_equal

from adaptive_flot.contracts import Decision, Estimate, Sample
from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.stepping.compiling import compiled
from adaptive_flot.greybox.stepping.compiling.compiled import compiler_problem
from adaptive_flot.runner.commands.runs import run as run_module
from adaptive_flot.runner.commands.runs.run import run_one, run_scenario
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.commands.runs.side_by_side import can_go_side_by_side, run_side_by_side
from adaptive_flot.runner.loop.prepared import Prepared
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario
from controllers.schedule import Schedule, ScheduleState
from tests.runner.conftest import WriteScenario

PROBLEM = compiler_problem()
needs_compiler = pytest.mark.skipif(PROBLEM is not None, reason=f"nothing can be compiled here: {PROBLEM}")


@pytest.fixture(autouse=True)
def own_cache(libraries: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(compiled, "cache_folder", lambda: libraries)
    yield
    compiled._compiler.cache_clear()


def side_by_side(scenario: Scenario, seeds: list[int]) -> list[Run | Exception]:
    prepared = Prepared.of(scenario, ["rpem"])
    return run_side_by_side(
        prepared, "rpem", "schedule", [Realisation(scenario, s) for s in seeds], [{} for _ in seeds]
    )


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"disturbances": {"feed_concentration.chalcopyrite": {"noise_std": 0.1}}},
    ],
    ids=["planned", "a constant of the feed measured with noise"],
)
def test_a_run_is_that_of_its_seed_alone(write_scenario: WriteScenario, changes: Mapping[str, Any]) -> None:
    """To rounding; and to the bit in whatever group it is."""
    scenario = load_scenario(write_scenario(changes)).compiled()
    prepared = Prepared.of(scenario, ["rpem"])
    runs = side_by_side(scenario, [1, 2, 3])
    for seed, run in zip([1, 2, 3], runs, strict=True):
        assert isinstance(run, Run)
        alone = run_one(prepared, "rpem", "schedule", Realisation(scenario, seed), {})
        assert (run.seed, run.status_counts) == (seed, alone.status_counts)
        assert list(run.table) == list(alone.table)
        assert_frame_equal(run.table, alone.table, check_exact=False, rtol=1e-6, atol=1e-9)
        assert run.fit == pytest.approx(alone.fit, rel=1e-6)
        np.testing.assert_allclose(run.initial.values(), alone.initial.values(), rtol=1e-6)
        (single,) = side_by_side(scenario, [seed])
        assert isinstance(single, Run)
        assert_frame_equal(run.table, single.table, check_exact=True)
        assert run.fit == single.fit


@needs_compiler
@pytest.mark.slow
def test_a_seed_that_can_not_run_does_not_stop_the_others(
    write_scenario: WriteScenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = load_scenario(write_scenario()).compiled()
    usual = Realisation.schedule.func  # type: ignore[attr-defined]

    def schedule(realisation: Realisation) -> Any:
        values = usual(realisation).copy()
        return values * 1e3 if realisation.seed == 2 else values

    monkeypatch.setattr(Realisation, "schedule", property(schedule))
    one, two, three = side_by_side(scenario, [1, 2, 3])
    assert isinstance(one, Run) and isinstance(three, Run)
    assert isinstance(two, RangeError) and "seed 2" in str(two)


@needs_compiler
@pytest.mark.slow
def test_the_command_takes_seeds_together_where_it_may(
    write_scenario: WriteScenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the order of the seeds, whatever went side by side; `oracle` does not."""
    groups: list[tuple[str, list[int]]] = []

    def seen(prepared: Prepared, name: str, controller: str, realisations: list[Realisation], fits: Any) -> Any:
        groups.append((name, [r.seed for r in realisations]))
        return run_side_by_side(prepared, name, controller, realisations, fits)

    monkeypatch.setattr(run_module, "run_side_by_side", seen)
    monkeypatch.setattr(run_module, "AT_ONCE", 2)
    names = ["oracle", "fixed", "rpem"]
    runs = run_scenario(load_scenario(write_scenario()).compiled(), names, seeds=[3, 1, 2])
    assert [(r.seed, r.estimator) for r in runs] == [(s, e) for s in (3, 1, 2) for e in names]
    assert groups == [("fixed", [3, 1]), ("rpem", [3, 1]), ("fixed", [2]), ("rpem", [2])]


class Watching(Schedule):
    """One that looks at the estimate, made from one that does not: it does not inherit what that one says."""

    def decide(
        self, state: ScheduleState, sample: Sample | None, estimate: Estimate | None
    ) -> tuple[ScheduleState, Decision]:
        state, decision = super().decide(state, sample, estimate)
        return state, decision if estimate is None else replace(decision, inputs=decision.inputs * 1.0001)


@pytest.mark.parametrize(
    ("changes", "estimator", "controller"),
    [
        ({}, "imm", "schedule"),
        ({}, "oracle", "schedule"),
        ({}, "rpem", f"{__file__}:Watching"),
        ({"plant": {"integrator": "accurate"}}, "rpem", "schedule"),
        ({"measurements.concentrate_grade.dead_time_s": 10}, "rpem", "schedule"),
        ({"measurements.level.frozen_after_s": 10}, "rpem", "schedule"),
    ],
)
def test_what_can_not_go_side_by_side(
    write_scenario: WriteScenario,
    changes: Mapping[str, Any],
    estimator: str,
    controller: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Asked without a compiler: nothing of it needs one, and a run falls back to the interpreter."""
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    scenario = load_scenario(write_scenario(changes)).compiled()
    prepared = Prepared.of(scenario, [estimator], [controller])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", compiled.CompileWarning)
        assert not can_go_side_by_side(prepared, estimator, controller, Realisation(scenario, 1))


def test_without_machine_code_everything_is_as_before(write_scenario: WriteScenario, tmp_path: Path) -> None:
    scenario = load_scenario(write_scenario())
    assert not can_go_side_by_side(Prepared.of(scenario, ["rpem"]), "rpem", "schedule", Realisation(scenario, 1))


class OneByOne(Schedule):
    """An open loop that is asked for each decision."""

    open_loop = True

    def decide(
        self, state: ScheduleState, sample: Sample | None, estimate: Estimate | None
    ) -> tuple[ScheduleState, Decision]:
        return super().decide(state, sample, estimate)


@needs_compiler
@pytest.mark.slow
def test_decisions_taken_at_once_are_those_taken_one_by_one(write_scenario: WriteScenario) -> None:
    scenario = load_scenario(write_scenario()).compiled()
    runs = []
    for use in ("schedule", f"{__file__}:OneByOne"):
        prepared = Prepared.of(scenario, ["rpem"], [use])
        assert can_go_side_by_side(prepared, "rpem", use, Realisation(scenario, 1))
        (run,) = run_side_by_side(prepared, "rpem", use, [Realisation(scenario, 1)], [{}])
        assert isinstance(run, Run)
        runs.append(run.table)
    assert_frame_equal(runs[0], runs[1], check_exact=True)
