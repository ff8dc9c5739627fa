"""Faults of instruments, actuators and optimisation: each acts as written, in its time, and nothing else changes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from adaptive_flot.contracts import Decision, DelayedValue, Estimate, PlantRecord, Sample, Status
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.runner.plants.faulty_controller import FaultyController
from adaptive_flot.runner.plants.faulty_plant import FaultyPlant
from adaptive_flot.runner.scenario.faults import ControllerFault, Fault, PlantFault
from adaptive_flot.testing import ControllerCase, controller_case
from controllers.economic_mpc.controller import EconomicMpc
from controllers.hold import Hold

ROWS = 400


@dataclass(frozen=True)
class Row:
    """Interval to come."""

    k: int


class Scripted:
    """Every output shows the time of the sample, and whatever is applied acts."""

    def __init__(self, model: Model, delayed: tuple[str, float] | None = None) -> None:
        self.outputs = len(model.outputs)
        self.delayed = delayed

    def init(self) -> Row:
        return Row(0)

    def apply(self, state: Row, inputs: FloatArray) -> tuple[Row, PlantRecord]:
        now = state.k + 1.0
        delayed: tuple[DelayedValue, ...] = ()
        outputs = np.full(self.outputs, now)
        if self.delayed is not None:
            name, dead_time = self.delayed
            delayed = (DelayedValue(name, now - dead_time, now - dead_time),)
            outputs[0] = np.nan
        sample = Sample(now, inputs, outputs, delayed)
        return Row(state.k + 1), PlantRecord(sample, np.full(self.outputs, now), np.zeros(0), inputs)


def fault(**entry: Any) -> Any:
    """As a scenario would give it."""
    made: Fault = TypeAdapter(Fault).validate_python(entry)
    return made


def play(model: Model, faults: list[PlantFault], plant: Scripted | None = None, seed: int = 1) -> list[PlantRecord]:
    """Air flow k + 1 is asked for in interval k."""
    draws = np.random.default_rng(seed).random((ROWS, len(faults), 2))
    faulty = FaultyPlant(plant or Scripted(model), faults, model, 1.0, draws)
    state, records = faulty.init(), []
    for k in range(ROWS):
        again = faulty.apply(state, np.array([k + 1.0, 0.0, 0.0]))
        state, record = faulty.apply(state, np.array([k + 1.0, 0.0, 0.0]))
        np.testing.assert_array_equal(again[1].sample.outputs, record.sample.outputs)  # state in, state out
        records.append(record)
    return records


def shown(records: list[PlantRecord], output: int = 0) -> FloatArray:
    return np.array([r.sample.outputs[output] for r in records])


TIMES = np.arange(1.0, ROWS + 1)
DURING = (TIMES >= 100) & (TIMES < 200)


def test_missing_values_are_nan_in_their_time_and_others_stay(model: Model) -> None:
    records = play(model, [fault(fault="missing", output="concentrate_grade", from_s=100, to_s=200)])
    np.testing.assert_array_equal(shown(records), np.where(DURING, np.nan, TIMES))
    np.testing.assert_array_equal(shown(records, 1), TIMES)
    assert [bool(r.faults) for r in records] == DURING.tolist()
    assert {name for r in records for name in r.faults} == {"missing concentrate_grade"}


def test_a_share_of_the_values_is_missing(model: Model) -> None:
    records = play(model, [fault(fault="missing", output="level", rate=0.3)])
    level = shown(records, model.index("outputs", "level"))
    assert np.isnan(level).mean() == pytest.approx(0.3, abs=0.07)
    assert [bool(r.faults) for r in records] == np.isnan(level).tolist()


def test_outliers_are_off_by_their_size_up_or_down(model: Model) -> None:
    records = play(model, [fault(fault="outliers", output="concentrate_grade", rate=0.2, size=0.5)])
    error = shown(records) - TIMES
    assert set(np.round(error, 9)) == {-0.5, 0.0, 0.5}
    assert np.mean(error != 0) == pytest.approx(0.2, abs=0.06)
    assert [bool(r.faults) for r in records] == (error != 0).tolist()


def test_a_frozen_instrument_repeats_its_last_value_then_follows_again(model: Model) -> None:
    records = play(model, [fault(fault="frozen", output="concentrate_grade", from_s=100, to_s=200)])
    np.testing.assert_array_equal(shown(records), np.where(DURING, 99.0, TIMES))


def test_faults_follow_a_delayed_value_by_the_time_it_was_taken(model: Model) -> None:
    """A value that was taken before the fault arrives unharmed while it lasts, and the other way round."""
    plant = Scripted(model, delayed=("concentrate_grade", 30.0))
    entry = fault(fault="outliers", output="concentrate_grade", rate=1.0, size=0.5, from_s=100, to_s=200)
    for record in play(model, [entry], plant):
        (value,) = record.sample.delayed
        assert abs(value.value - value.time) == (0.5 if 100 <= value.time < 200 else 0.0)
    frozen = play(model, [fault(fault="frozen", output="concentrate_grade", from_s=100, to_s=200)], plant)
    assert {r.sample.delayed[0].value for r in frozen if 100 <= r.sample.delayed[0].time < 200} == {
        69.0
    }  # known at 99 s


def test_a_slow_analyser_measures_at_its_period_and_tells_later(model: Model) -> None:
    """Every 50 s from 100 s on, known 20 s later, each value with the time at which it was taken."""
    entry = fault(fault="slow_analyser", output="concentrate_grade", every_s=50, dead_time_s=20, from_s=100)
    records = play(model, [entry])
    np.testing.assert_array_equal(shown(records), np.where(TIMES < 100, TIMES, np.nan))
    arrived = {
        r.sample.time: [(v.output, v.time, v.value) for v in r.sample.delayed] for r in records if r.sample.delayed
    }
    assert arrived == {t + 20.0: [("concentrate_grade", t, t)] for t in (100.0, 150.0, 200.0, 250.0, 300.0, 350.0)}


def test_a_slow_analyser_without_dead_time_leaves_gaps(model: Model) -> None:
    entry = fault(fault="slow_analyser", output="concentrate_grade", every_s=50, from_s=100, to_s=300)
    records = play(model, [entry])
    known = TIMES[np.isfinite(shown(records))]
    assert known.tolist() == [*range(1, 100), 100, 150, 200, 250, *range(300, ROWS + 1)]
    assert not any(r.sample.delayed for r in records)


def test_a_stuck_actuator_ignores_the_command_and_nobody_sees_it(model: Model) -> None:
    """From the interval that starts at 100 s the air of the interval before stays."""
    starts = np.arange(ROWS)
    acting = np.where((starts >= 100) & (starts < 200), 100.0, starts + 1.0)
    for measured in (False, True):
        entry = fault(fault="stuck", input="air_flow_m3_s", from_s=100, to_s=200, measured=measured)
        records = play(model, [entry])
        np.testing.assert_array_equal([r.inputs[0] for r in records], acting)
        known = acting if measured else starts + 1.0
        np.testing.assert_array_equal([r.sample.inputs[0] for r in records], known)


def test_entries_on_one_output_act_in_their_order(model: Model) -> None:
    """An outlier before the freeze is what freezes; after it, it rides on the frozen value."""
    outlier = fault(fault="outliers", output="concentrate_grade", rate=1.0, size=0.5)
    freeze = fault(fault="frozen", output="concentrate_grade", from_s=100, to_s=200)
    after = shown(play(model, [freeze, outlier]))[DURING]
    assert len(set(after)) == 2 and np.ptp(after) == 1.0
    assert len(set(shown(play(model, [outlier, freeze]))[DURING])) == 1


# -- the controller ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def case() -> ControllerCase:
    return controller_case(EconomicMpc, horizon=12, solver="fatrop")


def decide(
    case: ControllerCase, controller: FaultyController, state: Any, inputs: FloatArray, move: int
) -> tuple[Any, Decision]:
    sample = replace(case.samples[0], time=1.0 + 30.0 * move, inputs=inputs)
    return controller.decide(state, sample, replace(case.estimates[0], time=sample.time))


@pytest.mark.parametrize(
    ("entry", "name", "moves"),
    [
        ({"fault": "solver_failure", "from_s": 31, "to_s": 331}, "solver_failure", 10),
        ({"fault": "solver_failure", "from_s": 31, "to_s": 451}, "solver_failure", 14),
        ({"fault": "nan_state", "from_s": 31, "to_s": 61}, "nan_state", 1),
    ],
)
def test_the_step_after_a_failure_is_that_of_a_fresh_controller(
    case: ControllerCase, entry: dict[str, Any], name: str, moves: int
) -> None:
    """The fallback chain decides while it lasts, within the limits; afterwards nothing is left of it, to the bit."""
    given = fault(**entry)
    assert isinstance(given, ControllerFault) and case.setup.limits is not None
    controller = FaultyController(case.controller, [given])
    state, decision = decide(case, controller, controller.init(0.0), case.samples[0].inputs, 0)
    assert decision.status is Status.OK and not decision.faults
    for move in range(1, moves + 1):
        state, decision = decide(case, controller, state, decision.inputs, move)
        assert decision.faults == (name,) and np.isnan(decision.inputs).sum() == 0
        assert decision.status is (Status.SHIFTED_PLAN if move < 12 else Status.HELD)
        for quantity, (low, high) in case.setup.limits.inputs.items():
            assert low <= decision.inputs[case.setup.model.index("inputs", quantity)] <= high
    last = decision.inputs
    _, after = decide(case, controller, state, last, moves + 1)
    fresh = FaultyController(EconomicMpc(case.setup, horizon=12, solver="fatrop"), [])
    _, expected = decide(case, fresh, fresh.init(0.0), last, moves + 1)
    # after long held inputs no plan may keep the grade: both then give up the same, by the same
    assert after.status is expected.status and after.status in (Status.OK, Status.SOFTENED) and not after.faults
    assert dict(after.softened) == dict(expected.softened)
    np.testing.assert_array_equal(after.inputs, expected.inputs)


def test_a_controller_without_a_solver_has_none_to_fail(case: ControllerCase) -> None:
    given = fault(fault="solver_failure")
    assert isinstance(given, ControllerFault)
    controller = FaultyController(Hold(case.setup), [given])
    estimate: Estimate = case.estimates[0]
    _, decision = controller.decide(controller.init(0.0), case.samples[0], estimate)
    assert decision.decided_by == "hold" and not decision.faults
