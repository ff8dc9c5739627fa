"""A realisation is the same for all who ask, and a stream of random numbers depends on no other."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.runner.scenario.inputs.random_streams import Stream, generator
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario
from tests.runner.conftest import WriteScenario

NOISY = {
    "parameters.n": {"profile": "random_walk", "share_per_hour": 0.1},
    "faults": [
        {"fault": "missing", "output": "level", "rate": 0.5},
        {"fault": "outliers", "output": "concentrate_grade", "rate": 0.5, "size": 0.01},
    ],
}
ARRAYS = ("schedule", "plan", "parameters", "measurement_noise", "fault_draws")


def test_what_was_drawn_before_changes_nothing(write_scenario: WriteScenario) -> None:
    """Each quantity has its own stream: asked for alone, or after all others, it is the same to the bit."""
    scenario = load_scenario(write_scenario(NOISY))
    alone = {name: getattr(Realisation(scenario, 3), name) for name in ARRAYS}
    together = Realisation(scenario, 3)
    for name in reversed(ARRAYS):
        np.testing.assert_array_equal(getattr(together, name), alone[name])


def test_another_seed_draws_all_that_is_drawn_for_each_run_anew(write_scenario: WriteScenario) -> None:
    scenario = load_scenario(write_scenario(NOISY))
    one, other = Realisation(scenario, 3), Realisation(scenario, 4)
    for name in ARRAYS:
        assert not np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True), name


def test_nobody_can_write_to_what_all_runs_share(scenario: Scenario) -> None:
    realisation = Realisation(scenario, 1)
    for name in ARRAYS:
        with pytest.raises(ValueError, match="read-only"):
            getattr(realisation, name)[...] = 0.0


def test_streams_are_the_ones_of_earlier_results() -> None:
    """Results that are published are drawn again to the bit: their numbers are part of them."""
    assert {stream.name: int(stream) for stream in Stream} == {
        "MEASUREMENT_NOISE": 0,
        "INPUT_OF_RUN": 1,
        "INPUT": 2,
        "DISTURBANCE_NOISE": 3,
        "FAULT": 4,
        "RANDOM_WALK_OF_RUN": 6,
        "RANDOM_WALK": 7,
        "FEED_WALK_OF_RUN": 8,
        "FEED_WALK": 9,
    }
    assert generator(1, Stream.FAULT, 2).random() == np.random.default_rng([1, 4, 2]).random()


def test_a_scenario_prints_as_a_line_and_a_small_table(scenario: Scenario) -> None:
    text, page = repr(scenario), scenario._repr_html_()
    assert text.startswith("<Scenario name: short; model: flotation; duration: 120 s every 1 s; adapts: n, C")
    assert len(text) < 250 and "\n" not in text
    assert "<td>fixed, rpem</td>" in page and len(page) < 1500
    assert repr(Realisation(scenario, 2)) == "<Realisation scenario: short; seed: 2>"
