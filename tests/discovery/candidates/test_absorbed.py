"""Protects what adapted parameters take up: a gain of a sensor behind a gain, and nothing where none is adapted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.fitting.base_fit import prepare, split_record
from adaptive_flot.discovery.record.problem import CYCLE
from adaptive_flot.discovery.record.screening import screen
from adaptive_flot.greybox import Dataset
from tests.discovery.fitting.test_step_length import model

ROWS = 400


def _absorbed(adapted: tuple[str, ...]) -> frozenset[tuple[str, str]]:
    """What is taken up in a record of a coil that starts without a current."""
    coil = replace(model(), max_step_s=0.05, starts_steady=False, initial_guess={"current": 0.0})
    rng = np.random.default_rng(1)
    u = np.repeat(rng.uniform(-3.0, 3.0, ROWS // 4), 4)
    y = np.convolve(u, [0.0, 1.5])[:ROWS] + 0.02 * rng.standard_normal(ROWS)
    data = Dataset("coil", np.arange(ROWS, dtype=float), 1.0, u[:, None], y[:, None])
    problem, _ = split_record(screen(data, coil), coil, adapted, CYCLE)
    prepared = prepare(problem, coil)
    assert prepared is not None
    return Responses(*prepared).absorbed_constants()


def test_the_gain_of_a_sensor_is_that_of_what_drives_it() -> None:
    found = _absorbed(("tau", "gain"))
    assert {("ammeter", "factor"), ("supply", "factor")} <= found
    assert not {("ammeter", "offset"), ("supply", "offset")} & found


def test_nothing_is_taken_up_where_nothing_is_adapted() -> None:
    """Since a reference all constants are held."""
    assert not _absorbed(())
