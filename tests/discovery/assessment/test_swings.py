"""Protects: an error that swings is told with its period, and what wanders, or follows an input, is not."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.discovery.assessment.swings import swing_notes, swing_of
from adaptive_flot.greybox.data.dataset import Dataset
from tests.discovery.hypotheses.tank import tank

ROWS, DT = 1400, 2.0
TIME = DT * np.arange(ROWS, dtype=np.float64)
STILL = np.zeros((ROWS, 1))


@given(st.floats(60.0, 400.0), st.floats(0.0, 6.0), st.integers(0, 2**31))
@settings(max_examples=40, deadline=None)
def test_a_wave_is_found_with_its_period_and_size(period: float, phase: float, seed: int) -> None:
    """Under noise of half its size, with a tenth of the rows missing: period to 1 %, amplitude to 10 %."""
    rng = np.random.default_rng(seed)
    error = 20.0 * np.sin(2 * np.pi * TIME / period + phase) + 10.0 * rng.normal(size=ROWS)
    error[rng.random(ROWS) < 0.1] = np.nan
    swing = swing_of(error, STILL, DT)
    assert swing is not None
    assert abs(swing.period / period - 1) < 0.01 and abs(swing.amplitude / 20.0 - 1) < 0.1
    assert abs(swing.share - 2 / 3) < 0.1


def test_what_wanders_has_no_period() -> None:
    """First-order noise of any memory: hardly one record in a hundred looks like a wave."""
    found = 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        memory, walk = rng.uniform(0.0, 0.999), np.zeros(ROWS)
        for k, shock in enumerate(rng.normal(size=ROWS - 1), start=1):
            walk[k] = memory * walk[k - 1] + shock
        found += swing_of(walk, STILL, DT) is not None
    assert found <= 4


def test_what_an_input_does_as_often_is_no_hint() -> None:
    wave = np.sin(2 * np.pi * TIME / 260.0)
    assert swing_of(wave, STILL, DT) is not None
    assert swing_of(wave, np.sign(wave + 1e-9)[:, None], DT) is None


def test_nothing_measured_and_a_short_record_have_no_swing() -> None:
    assert swing_of(np.full(ROWS, np.nan), STILL, DT) is None
    assert swing_of(np.ones(ROWS), STILL, DT) is None
    assert swing_of(np.sin(TIME[:30]), STILL[:30], DT) is None


def test_outputs_that_swing_together_are_told_together() -> None:
    """One disturbance moves several outputs: one note says its period, and how large it is in each."""
    wave, quantity = np.sin(2 * np.pi * TIME / 260.0), tank().outputs[0]
    outputs = tuple(replace(quantity, name=name, unit=unit) for name, unit in (("heat", "K"), ("flow_1", "-")))
    model: Any = SimpleNamespace(outputs=outputs)
    record = Dataset("r", TIME, DT, STILL, np.zeros((ROWS, 2)))
    errors = np.column_stack([20.0 * wave, 0.3 * wave])
    (note,) = swing_notes(model, record, (0, 1), errors)
    assert note == (
        "errors swing up and down every 260 s: heat by 20 K (100 %), flow 1 by 0.3 (100 %) of the squared error: "
        "look for what comes and goes so often"
    )
    other = np.column_stack([20.0 * wave, np.sin(2 * np.pi * TIME / 100.0)])
    assert len(swing_notes(model, record, (0, 1), other)) == 2
