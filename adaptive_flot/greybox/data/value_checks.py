"""Whether what is in the columns of a record can be what they are called."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.data.swapped import Swapped, swapped
from adaptive_flot.greybox.data.wrong_unit import check_unit
from adaptive_flot.greybox.model import FloatArray, Model, Quantity


def check_values(
    model: Model, inputs: FloatArray, outputs: FloatArray, time: FloatArray, where: str
) -> tuple[str, ...]:
    """Refuse columns that can not be what they are called, and give a word on outputs that may not be.

    Parameters
    ----------
    model
        Units and physical ranges.
    inputs, outputs
        Of the record, (N, nu) and (N, ny), in the model's order.
    time
        Of each row [s] (N,).
    where
        The file, for messages.

    Raises
    ------
    RangeError
        An input outside the model's physical range, a column in another unit than its name says (`check_unit`), or two
        that have each other's values (`swapped`).
    """
    measured = tuple(_with_range(q, model) for q in model.outputs)
    of_inputs, of_outputs = swapped(model.inputs, inputs), swapped(measured, outputs)
    _refuse([p for p in (*of_inputs, *of_outputs) if p.certain], where)
    for q, column in zip((*model.inputs, *measured), (*inputs.T, *outputs.T), strict=True):
        check_unit(q, column, where)
    _refuse(of_inputs, where)
    model.check_inputs(inputs, time, where=where)
    return tuple(map(str, of_outputs))


def _refuse(pairs: Sequence[Swapped], where: str) -> None:
    if pairs:
        raise RangeError(f"{where}: {pairs[0]}; give each its own name, or correct the ranges in the model")


def _with_range(output: Quantity, model: Model) -> Quantity:
    """An output; where it has no range of its own, with that of the state that it shows: same name, same unit."""
    if output.usual is not None or np.isfinite([output.lower, output.upper]).any():
        return output
    shown = next((s for s in model.states if (s.name, s.unit) == (output.name, output.unit)), output)
    return replace(output, lower=shown.lower, upper=shown.upper)
