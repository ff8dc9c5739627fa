"""Protects: no name for a fault beyond what it can be, none for a stopped sensor that moves; bounds of constants."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses import cross_validation
from adaptive_flot.discovery.hypotheses.calibration import calibrate
from adaptive_flot.discovery.hypotheses.families import hypotheses
from adaptive_flot.discovery.hypotheses.joint.rows import Rows, rows_of
from adaptive_flot.discovery.hypotheses.plausible import at_edge, moves_though_stopped
from adaptive_flot.discovery.hypotheses.procedure import compare
from adaptive_flot.discovery.hypotheses.seen import seen_values
from adaptive_flot.greybox import Dataset, Effect
from adaptive_flot.greybox.model import FloatArray
from tests.discovery.hypotheses.tank import DRAUGHT, DT, NOISE, ROWS, record, tank


def span(slope: float) -> Effect:
    """A thermometer with a wrong span about 310 K."""
    return Effect("thermometer", "own_value", "span", {"offset": 0.0, "slope": slope}, {"middle": 310.0})


def one_hypothesis(label: str, new: Dataset) -> tuple[Rows, cross_validation.Tested]:
    """One hypothesis on a record, after a calibration with another one."""
    known = calibrate(tank(), [record("old", 2)], ("efficiency", "loss"), (0,), [new])
    rows = rows_of([new], (0,), [known.usual.sizes(new)], known.rows.memory)
    base = cross_validation.fit_all_rows(known.model, rows, None, known.constants, None)
    assert base is not None
    seen = seen_values(known.model, base.fit, [new])
    chosen = next(h for h in hypotheses(known.model, *seen, DT, DT * ROWS) if h.label == label)
    fitted = cross_validation.fit_all_rows(known.model, rows, chosen, known.constants, base.fit)
    assert fitted is not None
    return rows, cross_validation.test_on_stretches(known.model, rows, fitted, hold_constants=True)


@pytest.mark.parametrize(("slope", "edge"), [(-0.15, False), (-0.6, True)])
def test_a_span_that_no_calibration_error_has_is_at_its_edge(slope: float, edge: bool) -> None:
    assert at_edge(one_hypothesis("thermometer span", record("new", 1, span(slope)))[1]) is edge


def test_what_would_have_to_be_larger_than_it_can_be_is_not_named_alone() -> None:
    """A thermometer that hardly answers: an error of its span fits best, at the end of its range."""
    assert compare(tank(), [record("new", 1, span(-0.6))], [record("old", 2)]).verdict.word != "named"


def still(noise: float, step: float) -> FloatArray:
    """A value that stands still but for noise, in steps of an analog-digital converter."""
    y = 303.0 + noise * np.random.default_rng(0).normal(size=(ROWS, 1))
    return np.asarray(np.round(y / step) * step)


@pytest.mark.parametrize(
    ("outputs", "moves"),
    [(None, True), (still(0.0, 0.1), False), (still(0.04, 0.1), False), (still(NOISE, 1e-9), False)],
)
def test_a_sensor_that_moves_has_not_stopped(outputs: FloatArray | None, moves: bool) -> None:
    """Noise and flicker between two steps of a converter are no motion."""
    new = record("new", 1, DRAUGHT)
    new = new if outputs is None else replace(new, outputs=outputs)
    assert moves_though_stopped(tank(), *one_hypothesis("thermometer stuck", new)) is moves


def test_behind_a_stuck_valve_an_output_may_move() -> None:
    """By a disturbance that the model does not have: that is no evidence against the valve."""
    new = record("new", 1, DRAUGHT)
    rows, valve = one_hypothesis("heater stuck", new)
    at_rest = replace(valve.fit, errors=(new.outputs - 303.0,))
    assert not moves_though_stopped(tank(), rows, replace(valve, fit=at_rest))


def test_a_constant_at_its_bound_is_known_there() -> None:
    """The plant's efficiency is 0.9 and the model allows 0.85: the reference says so, and not nothing."""
    low = tank()
    efficiency = replace(low.parameters[0], upper=0.85)
    known = calibrate(replace(low, parameters=(efficiency, low.parameters[1])), [record("old", 2)],
                      ("efficiency", "loss"), (0,)).constants  # fmt: skip
    deviation = float(np.linalg.norm(known.root[0]))
    assert known.mean[0] == pytest.approx(0.85, abs=1e-3) and deviation < 0.1
