"""A record that does not start at rest, where the model assumes so, gets a word; one that does gets none."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox import Dataset
from adaptive_flot.greybox.steady.assumed_start import wrong_start
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.processes.registry import make_model
from tests.greybox.test_model_checks import box


def _record(initial_state: float | None = None) -> Dataset:
    power = np.full((60, 1), 2.0)
    state = None if initial_state is None else np.array([initial_state])
    return Dataset("record", np.arange(60.0), 1.0, power, np.zeros((60, 1)), initial_state=state)


def test_a_start_on_the_move_is_told_with_the_state_and_what_to_set() -> None:
    """At rest the warmth is power / k = 2 K."""
    said = wrong_start(box(), _record(), np.array([5.0]), np.array([1.0]), [0], np.array([0.1]))
    assert len(said) == 1 and "warmth 5 instead of 2 K" in said[0]
    assert "which is in order; to say so in a model of your own, set starts_steady=False and initial_guess" in said[0]


def test_nothing_is_said_where_the_start_is_at_rest_known_or_not_assumed() -> None:
    at_rest, away, p, noise = np.array([2.0]), np.array([5.0]), np.array([1.0]), np.array([0.1])
    assert wrong_start(box(), _record(), at_rest, p, [0], noise) == ()
    assert wrong_start(box(), _record(5.0), away, p, [0], noise) == ()
    assert wrong_start(box(starts_steady=False), _record(), away, p, [0], noise) == ()


def test_a_process_without_a_steady_state_is_told_so() -> None:
    """With k = 0 the box warms for ever."""
    said = wrong_start(box(), _record(), np.array([5.0]), np.array([0.0]), [0], np.array([0.1]))
    assert len(said) == 1 and "no steady state" in said[0]


def test_a_fitted_start_that_can_not_be_is_not_told_as_a_fact() -> None:
    """The cell starts at 0.35 m, as measured: a level of 0.16 m, and a flow below zero, are no facts."""
    model = make_model("flotation")
    inputs = np.tile([1.2e-3, 1.67e-4, 0.35], (60, 1))
    outputs = np.full((60, len(model.outputs)), np.nan)
    outputs[:, model.index("outputs", "level")] = 0.35
    record = Dataset("record", np.arange(60.0), 1.0, inputs, outputs)
    parameters = np.array([p.value for p in model.parameters])
    steady = steady_state(model, inputs[0], parameters).state
    start = steady * 1.3
    start[[model.index("states", name) for name in ("tails_flow", "level")]] = -1e-4, 0.16
    level = [model.index("outputs", "level")]
    (said,) = wrong_start(model, record, start, parameters, level, np.array([1e-3]))
    assert "tails_flow" not in said and "level" not in said
    assert said.count("instead of") == 4 and said.index("m_gangue") < said.index("gas_ratio_1")
    start = steady.copy()
    start[model.index("states", "level")] = 0.345
    outputs[:, level] = 0.343
    (said,) = wrong_start(model, record, start, parameters, level, np.array([1e-3]))
    assert "level 0.345 instead of 0.35 m" in said
