"""Whether a measured output is off from what its model gives by as much as another unit would make it."""

from __future__ import annotations

import numpy as np

from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.data.wrong_unit import other_units
from adaptive_flot.greybox.model import FloatArray, Model, Quantity
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper

FACTORS = (100, 1000)
"""Percent for a fraction, and the prefixes of units."""
NEAR = 3.0
"""Most by which the middle of an output may differ from such a factor."""
SMALL = 0.01
"""A fraction whose usual range is not known is looked at below this."""


def off_by_a_unit(model: Model, inputs: FloatArray, outputs: FloatArray) -> tuple[str, ...]:
    """A word on each output that is a hundredth or a thousandth, or so many times, of what the model gives.

    It is a hint and no error: a plant may be so far from its model. What is as usual is not looked at.

    Parameters
    ----------
    model
        The model, with its own parameter values.
    inputs
        Inputs of the record (N, nu).
    outputs
        Its outputs (N, ny); NaN where missing.
    """
    middle = [float(np.median(y[np.isfinite(y)])) if np.isfinite(y).any() else np.nan for y in outputs.T]
    if not any(_is_odd(q, value) for q, value in zip(model.outputs, middle, strict=True)):
        return ()
    u = np.median(inputs, axis=0)
    try:
        state = steady_state(model, u).state
    except RangeError:
        return ()
    expected = Stepper(model, model.max_step_s).call(state, 0.0, u, model.parameter_values)[1]
    said = []
    for q, value, usual in zip(model.outputs, middle, expected.tolist(), strict=True):
        ratio = value / usual if usual else np.nan
        times = [k for k in FACTORS if 1 / NEAR < abs(ratio) * k < NEAR or 1 / NEAR < abs(ratio) / k < NEAR]
        if not _is_odd(q, value) or ratio < 0 or not times:
            continue
        k = min(times, key=lambda k: abs(abs(np.log10(ratio)) - np.log10(k)))
        off = f"1/{k}" if ratio < 1 else f"{k} times"
        said.append(
            f"{q.name}: its median, {value:.3g} {q.unit}, is about {off} of the {usual:.3g} {q.unit} that the model "
            "gives with these inputs: check its unit".replace(" -,", ",").replace(" - that", " that")
        )
    return tuple(said)


def _is_odd(q: Quantity, value: float) -> bool:
    """Whether a value can be one in another unit: it is not usual, or small where nothing is known of what is."""
    if not other_units(q) or not np.isfinite(value) or value == 0:
        return False
    if q.usual is not None:
        return not q.usual[0] <= value <= q.usual[1]
    return q.unit == "-" and abs(value) < SMALL
