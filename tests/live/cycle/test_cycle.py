"""The cycle against a plant in the same process: closed loop, faults, restarts, and a replay to the bit."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sqlalchemy import func, select

from adaptive_flot.errors import LinkError
from adaptive_flot.greybox.data.dataset import read_dataset
from adaptive_flot.live.link.cycle import Cycle
from adaptive_flot.live.link.replay import replay
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.safety.tag_value import Quality, TagValue
from adaptive_flot.live.store import schema
from adaptive_flot.live.store.memory import Memory, open_database
from adaptive_flot.live.store.record import record_table, stretches
from adaptive_flot.runner.scenario.scenario import Scenario
from tests.live.bench import INITIAL, Bench, Distort

AtClosed = Callable[..., Bench]


def test_from_monitor_to_closed_and_back_without_a_bump(cycle: Cycle) -> None:
    bench = Bench(cycle)
    bench.run(INITIAL + 3)
    acting = [dict(bench.direct.state.panel.acting)]
    modes = []
    plan = {0: Mode.CLOSED, 40: Mode.ADVISORY, 50: Mode.CLOSED, 70: Mode.OFF}

    def operate(k: int) -> None:
        if k in plan:
            bench.direct.operate("switch", plan[k])
        acting.append(dict(bench.direct.state.panel.acting))

    outcomes = bench.run(90, operate)
    modes = [o.mode for o in outcomes]
    assert modes[3] is Mode.CLOSED and modes[30] is Mode.CLOSED
    assert modes[45] is Mode.ADVISORY and modes[60] is Mode.CLOSED and modes[80] is Mode.OFF
    assert sum(len(o.writes) for o in outcomes) > 10
    for name, limit in bench.direct.plant.limits.items():
        values = np.array([a[name] for a in acting])
        assert np.abs(np.diff(values)).max() <= limit.rate * (1 + 1e-6)
        assert values.min() >= limit.low and values.max() <= limit.high
    assert bench.direct.state.panel.refused == 0


def test_advice_is_decided_and_not_written(at_closed: AtClosed) -> None:
    bench = at_closed()
    bench.direct.operate("switch", Mode.ADVISORY)
    outcomes = bench.run(10)
    assert all(o.decision is not None for o in outcomes)
    assert not any(o.writes or o.asks_control for o in outcomes)


def changed(**how: object) -> Distort:
    """The grade as an instrument fault shows it from a row on."""

    def distort(name: str, tag: TagValue, row: int) -> TagValue | None:
        if name != how["name"] or row < INITIAL + 20:
            return tag
        made = how["make"]
        assert callable(made)
        out: TagValue | None = made(tag)
        return out

    return distort


FAULTS: dict[str, Callable[[TagValue], TagValue | None]] = {
    "bad": lambda tag: replace(tag, quality=Quality.BAD),
    "uncertain": lambda tag: replace(tag, quality=Quality.UNCERTAIN),
    "silent": lambda tag: None,
    "not a number": lambda tag: replace(tag, value=math.nan),
    "out of range": lambda tag: replace(tag, value=50.0),
}


@pytest.mark.parametrize(
    ("name", "fault"), [*(("air_flow", f) for f in FAULTS), *(("acting air_flow", f) for f in ("bad", "out of range"))]
)
def test_no_move_is_computed_from_an_input_that_is_not_good(at_closed: AtClosed, fault: str, name: str) -> None:
    """The link sheds after three bad cycles, and the plant holds what acted."""
    bench = at_closed(changed(name=name, make=FAULTS[fault]))
    outcomes = bench.run(40)
    first = next(i for i, o in enumerate(outcomes) if o.faults)
    assert not any(o.writes for o in outcomes[first:])
    assert outcomes[first + 2].mode is Mode.SHED
    assert outcomes[first + 1].mode is Mode.CLOSED
    assert outcomes[-1].mode is Mode.SHED


@pytest.mark.parametrize("fault", FAULTS)
def test_a_bad_measurement_is_missing_and_too_long_without_one_sheds(at_closed: AtClosed, fault: str) -> None:
    """For its time until stale (10 s) the link goes on from the prediction; then it gives up."""
    bench = at_closed(changed(name="concentrate_grade", make=FAULTS[fault]))
    outcomes = bench.run(40)
    j = bench.cycle.link.scenario.model.index("outputs", "concentrate_grade")
    missing = [i for i, o in enumerate(outcomes) if o.sample is not None and math.isnan(o.sample.outputs[j])]
    assert outcomes[missing[0]].mode is Mode.CLOSED
    shed = next(i for i, o in enumerate(outcomes) if o.mode is Mode.SHED)
    assert missing[0] + 10 <= shed <= missing[0] + 13


def test_a_failed_write_sheds_after_three(at_closed: AtClosed) -> None:
    bench = at_closed()
    modes = []
    for _ in range(4):
        bench.direct.interval()
        modes.append(bench.step(bench.direct.snapshot(written=False)).mode)
    assert modes == [Mode.CLOSED, Mode.CLOSED, Mode.SHED, Mode.SHED]


def test_the_plant_is_silent_then_back(at_closed: AtClosed) -> None:
    """No sample: three cycles, then shed. Back again, samples go on, the gap filled with missing ones."""
    bench = at_closed()
    last = bench.state.sample
    silent = [bench.step(bench.direct.snapshot(alive=False)) for _ in range(5)]
    assert [o.mode for o in silent] == [Mode.CLOSED] * 2 + [Mode.SHED] * 3
    assert not any(o.writes for o in silent)
    for _ in range(7):
        bench.direct.interval()
    outcome = bench.step(bench.direct.snapshot())
    assert last is not None and outcome.sample is not None
    assert outcome.sample.time == last.time + 7
    assert outcome.estimate is not None


@pytest.mark.parametrize("jump", [-3600.0, 3600.0])
def test_the_plants_clock_jumps(at_closed: AtClosed, jump: float) -> None:
    bench = at_closed()
    bench.direct.clock += jump
    outcomes = bench.run(20)
    assert not outcomes[0].writes or jump > 0
    assert outcomes[-1].estimate is not None and np.isfinite(outcomes[-1].estimate.state).all()
    times = [o.sample.time for o in outcomes if o.sample is not None]
    assert (np.diff(times) > 0).all()


def test_the_operators_limits_bind(at_closed: AtClosed) -> None:
    bench = at_closed()
    acting = bench.direct.state.panel.acting["air_flow"]
    bench.direct.operate("air_flow.low", acting - 1e-6)
    bench.direct.operate("air_flow.high", acting + 1e-6)
    outcomes = bench.run(30)
    assert all(abs(o.writes.get("air_flow", acting) - acting) <= 1e-6 * (1 + 1e-9) for o in outcomes)
    assert bench.direct.state.panel.refused == 0


@pytest.fixture
def memory(link: Link, tmp_path: Path) -> Memory:
    return Memory(open_database("sqlite:///memory.sqlite", tmp_path), link)


def test_what_is_stored_replays_to_the_bit(cycle: Cycle, link: Link, memory: Memory, tmp_path: Path) -> None:
    bench = Bench(cycle, memory=memory)
    bench.to_closed()
    bench.direct.operate("air_flow.high", 1.6e-3)
    bench.run(60)
    found = replay(open_database("sqlite:///memory.sqlite", tmp_path), link)
    assert (found.different, found.cycles) == (0, INITIAL + 67)
    assert found.estimates > 60 and found.decisions > 60


def test_a_replay_notices_a_changed_value(cycle: Cycle, link: Link, memory: Memory, tmp_path: Path) -> None:
    bench = Bench(cycle, memory=memory)
    bench.to_closed()
    engine = open_database("sqlite:///memory.sqlite", tmp_path)
    row = (schema.tags.c.cycle == 5) & (schema.tags.c.tag == "air_flow")
    with engine.begin() as connection:
        connection.execute(schema.tags.update().where(row).values(value=1.41e-3))
    assert replay(engine, link).different > 0


def test_a_restart_goes_on_from_the_last_estimate_in_monitor(
    cycle: Cycle, link: Link, memory: Memory, tmp_path: Path
) -> None:
    bench = Bench(cycle, memory=memory)
    bench.to_closed()
    last = bench.run(30)[-1].estimate
    memory.close()
    bench.restart(Memory(open_database("sqlite:///memory.sqlite", tmp_path), link))
    again = bench.run(5)
    assert last is not None and bench.memory is not None and bench.memory.resumed is not None
    assert np.array_equal(bench.memory.resumed.prior.parameters, last.parameters)
    assert [o.mode for o in again] == [Mode.MONITOR] * 5
    assert again[0].estimate is not None
    assert again[0].estimate.parameters == pytest.approx(last.parameters, rel=0.05)
    assert replay(open_database("sqlite:///memory.sqlite", tmp_path), link).different == 0


def test_the_same_cycle_can_not_be_stored_twice(cycle: Cycle, link: Link, memory: Memory, tmp_path: Path) -> None:
    bench = Bench(cycle)
    bench.direct.interval()
    snapshot = bench.direct.snapshot()
    outcome = bench.step(snapshot)
    memory.store(snapshot, outcome, None, {})
    with pytest.raises(LinkError, match="database: can not be written"):
        memory.store(snapshot, outcome, None, {})
    engine = open_database("sqlite:///memory.sqlite", tmp_path)
    with engine.connect() as connection:
        counts = [
            connection.execute(select(func.count()).select_from(t)).scalar() for t in (schema.cycles, schema.samples)
        ]
    assert counts == [1, 1]


def test_an_exported_record_is_what_was_measured(cycle: Cycle, link: Link, memory: Memory, tmp_path: Path) -> None:
    bench = Bench(cycle, memory=memory)
    outcomes = bench.run(30)
    (stretch,) = stretches(open_database("sqlite:///memory.sqlite", tmp_path), link)
    table = record_table(link, stretch)
    table.to_csv(tmp_path / "record.csv", index=False)
    record = read_dataset(tmp_path / "record.csv", link.scenario.model)
    samples = [o.sample for o in outcomes if o.sample is not None]
    assert np.array_equal(record.outputs, [s.outputs for s in samples], equal_nan=True)
    assert np.array_equal(record.inputs, [s.inputs for s in samples])


def test_measured_parameters_and_delayed_values_arrive_where_they_belong(
    write_live_scenario: Callable[[Mapping[str, object]], Scenario], write_link: Callable[..., Link]
) -> None:
    """The link's samples are those that a run of the scenario would have handed to its estimator."""
    scenario = write_live_scenario(
        {
            "disturbances": {"feed_concentration.chalcopyrite": {"noise_std": 0.1, "every_s": 5}},
            "measurements.concentrate_grade.dead_time_s": 3,
        }
    )
    bench = Bench(Cycle(write_link(scenario, {"controller": "hold"})))
    compared = 0
    for _ in range(INITIAL + 8):
        truth = bench.direct.interval().sample
        outcome = bench.step(bench.direct.snapshot())
        if outcome.sample is None:
            continue
        assert outcome.sample.time == truth.time
        assert np.array_equal(outcome.sample.outputs, truth.outputs, equal_nan=True)
        assert truth.parameters is not None and outcome.sample.parameters is not None
        assert np.array_equal(outcome.sample.parameters, truth.parameters)
        assert outcome.sample.delayed == truth.delayed
        compared += len(truth.delayed)
    assert compared > 10
    assert outcome.estimate is not None
