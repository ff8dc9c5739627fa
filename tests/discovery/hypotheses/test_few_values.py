"""Protects: a healthy plant gets no name for the drift of what integrates, while what says more gets worse."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from adaptive_flot.discovery.hypotheses.comparison import Blocks, rests_on_few_values
from adaptive_flot.discovery.hypotheses.joint.rows import Rows
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray

ROWS = 600
BLOCKS = Blocks(tuple((0, a, a + 50) for a in range(0, ROWS, 50)))
DRIFT = np.sin(np.linspace(0.0, 3.0, ROWS))
NOISE = np.random.default_rng(4).normal(size=ROWS)


def rests(before: FloatArray, after: FloatArray) -> bool:
    """For errors (ROWS, 2) of the model as it is, and with a hypothesis."""
    record = Dataset("r", np.arange(ROWS, dtype=float), 1.0, np.zeros((ROWS, 1)), np.zeros((ROWS, 2)))
    rows = Rows((record,), (0, 1), (np.ones((ROWS, 2)),), (np.ones(ROWS, dtype=bool),))
    plain, with_it = (SimpleNamespace(fresh=[e]) for e in (before, after))
    return rests_on_few_values(rows, BLOCKS, plain, with_it)  # type: ignore[arg-type]


def errors(drift: float, noise: float) -> FloatArray:
    """Errors of a speed that drifts, and of a flow that is at its noise."""
    return np.column_stack([drift * DRIFT + 0.01 * NOISE, noise * NOISE])


def test_a_drift_that_shrinks_while_a_flow_gets_surely_worse_is_no_evidence() -> None:
    assert rests(errors(2.0, 1.0), errors(1.0, 1.04))


def test_a_drift_that_shrinks_alone_is_evidence() -> None:
    assert not rests(errors(2.0, 1.0), errors(1.0, 1.0))


def test_what_has_many_values_is_evidence_though_a_drift_gets_worse() -> None:
    assert not rests(errors(1.0, 2.0), errors(1.5, 1.0))
