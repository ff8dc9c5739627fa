"""Protects: a record whose errors are noise is explained, whatever was not told apart; one with a memory is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.record.robust import memory, without_memory
from adaptive_flot.discovery.results import Discovery, OutputChange, State
from adaptive_flot.discovery.verdict.at_noise import none_at_noise
from tests.discovery.verdict.test_fallbacks import FAN, SENSOR, left_open


def undecided(draught: Discovery, times: float, errors: np.ndarray) -> State:
    """A record that is not told, with errors of the model as it is so many times the noise, and so in its rows."""
    state = left_open(draught, (FAN, SENSOR))
    problem, (before, _) = state.known_problem, state.refitted
    outputs = problem.record.outputs.copy()
    outputs[:, list(problem.columns)] = before.predicted + errors[: len(outputs), None]
    error = tuple(
        OutputChange(c.output, c.unit, times * c.noise, 0.98 * times * c.noise, c.noise, (0.0, 0.04))
        for c in state.error
    )
    record = replace(problem.record, outputs=outputs)
    return replace(state, problem=replace(problem, record=record), error=error, certain="something")


WHITE = np.random.default_rng(3).standard_normal(100_000)


def test_errors_that_are_noise_are_explained_and_a_note_says_what_came_nearest(draught: Discovery) -> None:
    told = none_at_noise(undecided(draught, 1.05, WHITE))
    assert told.judged.word == "none" and told.judged.best is None
    assert not told.certain and not told.contradiction
    assert all(c.after == c.before for c in told.error)
    assert "noise from row to row" in told.sentence
    assert told.screening.notes[-1].endswith("explains most: an error is 2 % smaller with it, at most")


@pytest.mark.parametrize(
    ("times", "errors"),
    [
        (1.15, np.convolve(WHITE, [0.9, 0.2])),  # more than noise
        (1.05, np.convolve(WHITE, [0.6, 0.5])),  # differences of what moves fast pass for noise
    ],
)
def test_what_is_more_than_noise_stays_open(draught: Discovery, times: float, errors: np.ndarray) -> None:
    state = undecided(draught, times, errors)
    assert none_at_noise(state) is state


def test_a_name_stays_however_small_what_it_explains(draught: Discovery) -> None:
    state = undecided(draught, 1.05, WHITE)
    named = replace(state, judgement=replace(state.judged, word="named"))
    assert none_at_noise(named) is named


def test_memory_is_the_correlation_of_neighbours_and_holes_count_for_nothing() -> None:
    rng = np.random.default_rng(0)
    e = np.zeros(20_000)
    for k in range(1, len(e)):
        e[k] = 0.6 * e[k - 1] + rng.standard_normal()
    with_holes = e.copy()
    with_holes[::7] = np.nan
    found = memory(np.column_stack([e, with_holes, WHITE[: len(e)], np.full(len(e), np.nan)]))
    np.testing.assert_allclose(found, [0.6, 0.6, 0.0, 0.0], atol=0.03)


def test_outliers_and_noise_that_grows_with_the_value_have_no_memory() -> None:
    rng = np.random.default_rng(1)
    moves = np.cumsum(rng.standard_normal(3000))
    outliers = rng.standard_normal(3000)
    outliers[::100] = 30.0
    errors = np.column_stack([outliers, np.linspace(0.1, 5.0, 3000) * rng.standard_normal(3000), 0.05 * moves])
    measured = np.repeat(moves[:, None], 3, axis=1)
    assert without_memory(errors, measured).tolist() == [True, True, False]
    # an error of what jumps from row to row has no memory whatever its cause is
    assert not without_memory(errors, rng.standard_normal((3000, 3))).any()


def test_a_record_with_outliers_is_explained_though_its_errors_are_far_above_the_noise(draught: Discovery) -> None:
    outliers = WHITE.copy()
    outliers[::50] = 20.0
    assert none_at_noise(undecided(draught, 3.0, outliers)).judged.word == "none"
