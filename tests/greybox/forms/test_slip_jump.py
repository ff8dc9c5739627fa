"""A valve that jumps, as a form: the run is that of a model whose input was replaced by the positions, row by row."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.discovery.record.slip_jump import jumped
from adaptive_flot.greybox import Effect
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.stepper import Stepper
from tests.discovery.heated import DT, heated_tank

SPREAD, EFFICIENCY = 800.0, 0.9


def _runs(
    asked: FloatArray, band: float, rest: float, interval: float, step: float, *, code: bool
) -> tuple[FloatArray, FloatArray]:
    """Outputs of a tank whose heater jumps, and of one that is told its positions; one of both as machine code."""
    tank = replace(heated_tank(), max_step_s=step)
    settings_of = {"scale": SPREAD, "interval_s": interval}
    shape = {"amplitude": 1.0, "band": EFFICIENCY * band, "rest": EFFICIENCY * rest}
    effect = Effect("heating", "lag", "slip_jump", shape, settings_of)
    jumps = replace(tank.with_effects([effect]), record_code=code)
    fan, start = np.full(len(asked), 10.0), np.array([310.0])
    found = Stepper(jumps, DT).simulate(np.append(start, EFFICIENCY * asked[0] / SPREAD), np.column_stack([asked, fan]))
    sought = Stepper(tank, DT).simulate(start, np.column_stack([jumped(asked, band, rest), fan]))
    return found.outputs, sought.outputs


@settings(deadline=None, max_examples=20)
@given(
    st.integers(0, 10_000),
    st.floats(50.0, 900.0),
    st.sampled_from([0.0, 0.3, 0.8]),
    st.sampled_from([0.5, 1.0, 2.0, 4.0]),
    st.sampled_from([1, 2, 5, 8]),
)
def test_the_run_is_that_of_the_positions_whatever_the_steps(
    seed: int, band: float, rest: float, share: float, substeps: int
) -> None:
    """No demand is within 4 % of the band: there the form creeps."""
    unit = band / 1.05
    asked = 1700.0 + 0.1 * unit * np.cumsum(np.random.default_rng(seed).integers(-12, 13, 60)).astype(np.float64)
    rest *= unit
    assert np.count_nonzero(np.diff(jumped(asked, band, rest))) > 3
    found, sought = _runs(asked, band, rest, share * DT, DT / substeps, code=False)
    np.testing.assert_allclose(found, sought, rtol=1e-7)


def test_machine_code_for_a_record_does_the_same() -> None:
    rng = np.random.default_rng(1)
    asked = 1700.0 + 100.0 * np.repeat(np.cumsum(rng.integers(-2, 3, 100)).astype(np.float64), 4)
    found, sought = _runs(asked, 350.0, 100.0, DT, 10.0, code=True)
    assert np.count_nonzero(np.diff(jumped(asked, 350.0, 100.0))) > 2
    np.testing.assert_allclose(found, sought, rtol=1e-9)
