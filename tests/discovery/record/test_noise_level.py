"""Protects names from an output that becomes noisy: its rows then count less, and only true noise counts as such."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.record.noise_level import NoiseChange, noise_changes, noise_levels
from adaptive_flot.discovery.record.screening import where_noise_changes
from tests.discovery.heated import Truth, heated_tank, tank_record

ROWS = 900


@given(st.integers(0, 10**6), st.floats(6.0, 20.0), st.integers(150, ROWS - 150), st.booleans())
def test_a_change_is_found_with_its_time_and_size(seed: int, ratio: float, row: int, quieter: bool) -> None:
    """Beside an output that does not change, slow errors of a model, and values that are missing."""
    rng = np.random.default_rng(seed)
    e = rng.standard_normal((ROWS, 2)) + 3 * np.sin(np.arange(ROWS) / 90.0)[:, None]
    noisy = np.arange(ROWS) < row if quieter else np.arange(ROWS) >= row
    e[noisy, 1] += (ratio - 1) * rng.standard_normal(noisy.sum())
    e[rng.random((ROWS, 2)) < 0.1] = np.nan
    (change,) = noise_changes(e)
    assert change.column == 1
    assert abs(change.row - row) <= 25
    true = np.hypot(1.0, ratio - 1)
    assert change.ratio == pytest.approx(1 / true if quieter else true, rel=0.35)


@given(st.integers(0, 10**6), st.floats(0.0, 0.9))
def test_no_change_is_found_where_there_is_none(seed: int, memory: float) -> None:
    """With a memory and heavy tails, too."""
    rng = np.random.default_rng(seed)
    e = rng.standard_t(4, (ROWS, 2))
    for k in range(1, ROWS):
        e[k] += memory * e[k - 1]
    assert noise_changes(e) == ()


def test_what_moves_from_row_to_row_is_no_noise() -> None:
    """A model that lacks something fast errs by more when its input begins to move."""
    rng = np.random.default_rng(3)
    moves = np.convolve(rng.standard_normal(ROWS + 4), np.ones(5), "valid")
    e = 0.1 * rng.standard_normal((ROWS, 1)) + np.where(np.arange(ROWS) >= 500, moves, 0.0)[:, None]
    assert noise_changes(e) == ()


def test_levels_are_one_on_the_quieter_side() -> None:
    levels = noise_levels([NoiseChange(0, 2, 5.0), NoiseChange(1, 3, 0.25)], 4, 3)
    assert levels.tolist() == [[1, 4, 1], [1, 4, 1], [5, 4, 1], [5, 1, 1]]


def test_the_words_have_time_and_size() -> None:
    changes = (NoiseChange(0, 2, 5.0), NoiseChange(1, 3, 0.25))
    said = [str(s) for s in where_noise_changes(changes, ["level", "grade"], 10.0 * np.arange(4, dtype=float))]
    assert said == [
        "the noise of level becomes 5 times as large at 20 s",
        "the noise of grade becomes 4 times smaller at 30 s",
    ]


def test_a_thermometer_that_becomes_noisy_is_noted_and_named_for_nothing() -> None:
    record = tank_record(Truth(exponent=0.0))
    outputs, half = record.outputs.copy(), len(record) // 2
    outputs[half:, 0] += 2.0 * np.random.default_rng(2).standard_normal(len(record) - half)
    found = discover(heated_tank(), replace(record, outputs=outputs)).verdict
    assert found.word == "none", found.reason
    (note,) = (n for n in found.notes if "noise of temperature becomes" in n)
    assert "rows with more noise count less" in note
    seconds = float(note.split(" at ")[1].split(" s")[0])
    assert seconds == pytest.approx(record.time[half], abs=30 * record.dt)
