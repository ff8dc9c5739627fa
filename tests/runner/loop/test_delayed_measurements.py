"""Measurements at their own rate and with dead time, from the scenario file to the table of a run."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.contracts import Status
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.plants.scenario_plant import simulate_plant
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.measurement_noise import measured_at
from adaptive_flot.runner.scenario.realisation import Realisation
from tests.runner.conftest import DURATION, INITIAL, WriteScenario

GRADE = "concentrate_grade"


def test_plant_shows_each_output_at_its_rate_and_delayed_ones_after_their_dead_time(
    write_scenario: WriteScenario,
) -> None:
    """Every 7 s from 7 s on, known 10 s later: the same values as without dead time, each once."""
    plain = load_scenario(write_scenario({f"measurements.{GRADE}.every_s": 7}))
    in_time = simulate_plant(Realisation(plain, 1))
    late = {"noise_std": 1e-3, "every_s": 7, "dead_time_s": 10}
    delayed = simulate_plant(Realisation(load_scenario(write_scenario({f"measurements.{GRADE}": late})), 1))
    column = plain.model.index("outputs", GRADE)
    taken = {r.sample.time: r.sample.outputs[column] for r in in_time if np.isfinite(r.sample.outputs[column])}
    assert list(taken) == [float(t) for t in range(7, DURATION + 1, 7)]
    arrived = {r.sample.time: r.sample.delayed for r in delayed if r.sample.delayed}
    assert [(t, v[0].time) for t, v in arrived.items()] == [(t + 10, t) for t in taken if t + 10 <= DURATION]
    assert all(v[0].value == taken[v[0].time] and v[0].output == GRADE for v in arrived.values())
    assert all(np.isnan(r.sample.outputs[column]) for r in delayed)
    level = plain.model.index("outputs", "level")
    assert all(a.sample.outputs[level] == b.sample.outputs[level] for a, b in zip(in_time, delayed, strict=True))


def test_a_period_that_is_no_multiple_of_the_sampling_interval_keeps_its_mean_rate(
    write_scenario: WriteScenario,
) -> None:
    scenario = load_scenario(write_scenario({f"measurements.{GRADE}.every_s": 2.5}))
    measured = measured_at(scenario)[:, scenario.model.index("outputs", GRADE)]
    assert list(np.flatnonzero(measured) + 1)[:6] == [3, 5, 8, 10, 13, 15]
    assert measured.sum() == DURATION / 2.5


@pytest.mark.parametrize("dead_time", [0, 12])
def test_table_shows_delayed_values_and_their_innovations_at_the_time_they_were_taken(
    write_scenario: WriteScenario, dead_time: int
) -> None:
    grade = {"noise_std": 1e-3, "every_s": 5, "dead_time_s": dead_time}
    changes = {f"measurements.{GRADE}": grade, "initial_estimate.guess": {}}
    run = run_scenario(load_scenario(write_scenario(changes)), ["rpem"], [1])[0]
    table = run.table[run.table["time_s"] > INITIAL]
    arrivals = sum(INITIAL < t + dead_time <= DURATION and t > INITIAL for t in range(5, DURATION + 1, 5))
    assert run.status_counts.get("delayed", 0) == (arrivals if dead_time else 0)
    measured = table.loc[table[f"{GRADE}_measured"].notna(), "time_s"].tolist()
    assert measured == [t for t in range(INITIAL + 1, DURATION - dead_time + 1) if t % 5 == 0]
    assert table.loc[table[f"{GRADE}_innovation"].notna(), "time_s"].tolist() == measured
    assert {Status[s.upper()] for s in run.status_counts} <= {
        Status.INITIALISING, Status.OK, Status.MISSING, Status.DELAYED, Status.TOO_OLD
    }  # fmt: skip
