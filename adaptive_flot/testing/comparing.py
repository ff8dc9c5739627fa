"""Comparisons that the checks share."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from adaptive_flot.greybox.model import FloatArray


def assert_frozen(state: Any) -> None:
    """Fail unless the state is a frozen dataclass."""
    assert dataclasses.is_dataclass(state), "the state must be a dataclass"
    field = dataclasses.fields(state)[0].name
    try:
        setattr(state, field, None)
    except dataclasses.FrozenInstanceError:
        return
    raise AssertionError("the state must be a frozen dataclass")


def arrays(value: Any) -> list[FloatArray]:
    """The array fields of a dataclass."""
    fields = [getattr(value, f.name) for f in dataclasses.fields(value)]
    return [f for f in fields if isinstance(f, np.ndarray)]


def same(a: Any, b: Any) -> bool:
    """Equal to the bit, through dataclasses and sequences, NaN equal to NaN."""
    if isinstance(a, np.ndarray):
        return bool(isinstance(b, np.ndarray) and np.array_equal(a, b, equal_nan=True))
    if dataclasses.is_dataclass(a):
        return type(a) is type(b) and all(same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    return bool(a == b) or (isinstance(a, float) and isinstance(b, float) and np.isnan(a) and np.isnan(b))
