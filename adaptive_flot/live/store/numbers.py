"""Arrays as text that people can read in any database and that comes back to the bit."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

from adaptive_flot.greybox.model import FloatArray


def as_text(values: FloatArray) -> str:
    """An array of any shape as nested lists; `null` stands for NaN.

    >>> as_text(np.array([0.1, np.nan]))
    '[0.1, null]'
    """
    return json.dumps(_plain(values.tolist()))


def as_array(text: str) -> FloatArray:
    """The array in a text.

    >>> as_array("[0.1, null]")
    array([0.1, nan])
    """
    return np.array(json.loads(text), dtype=float)


def as_column(value: float) -> float | None:
    """A number for a column; a database keeps no NaN."""
    return value if math.isfinite(value) else None


def from_column(value: float | None) -> float:
    """The number in a column."""
    return math.nan if value is None else float(value)


def _plain(value: Any) -> Any:
    """Lists with None for what is not a number; infinities stay, as JSON's extension writes them."""
    if isinstance(value, list):
        return [_plain(v) for v in value]
    return None if math.isnan(value) else value
