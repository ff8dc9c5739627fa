"""Two columns of a table that may have each other's values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from adaptive_flot.greybox.quantities import FloatArray, Quantity


@dataclass(frozen=True)
class Swapped:
    """Two quantities whose columns may be swapped.

    Attributes
    ----------
    outside, other
        The median of the first is outside its physical range. With the values of the other it would not be, and the
        other has room for its values.
    medians
        Of the column of each.
    certain
        Whether the other is outside its range as well.
    """

    outside: Quantity
    other: Quantity
    medians: tuple[float, float]
    certain: bool

    def __str__(self) -> str:
        a, b = self.outside, self.other
        low, high = f"{self.medians[0]:g} {a.unit}", f"{self.medians[1]:g} {b.unit}"
        where = "both are outside their ranges" if self.certain else f"the first is outside [{a.lower:g}, {a.upper:g}]"
        how = "seem to be" if self.certain else "may be"
        return f"columns {a.column!r} and {b.column!r} {how} swapped: their medians are {low} and {high}, {where}"


def swapped(quantities: Sequence[Quantity], table: FloatArray) -> list[Swapped]:
    """Pairs of columns of a table (N, n), a column a quantity with NaN where it is missing, that may be swapped.

    Only quantities with both ends of a range can tell.
    """
    known = [
        (q, float(np.median(values[np.isfinite(values)])))
        for q, values in zip(quantities, table.T, strict=True)
        if np.isfinite(values).any() and np.isfinite([q.lower, q.upper]).all()
    ]
    found: list[Swapped] = []
    for (a, of_a), (b, of_b) in permutations(known, 2):
        told = any((s.outside, s.other) == (b, a) for s in found)
        if not told and not _holds(a, of_a) and _holds(a, of_b) and _holds(b, of_a):
            found.append(Swapped(a, b, (of_a, of_b), certain=not _holds(b, of_b)))
    return found


def _holds(quantity: Quantity, value: float) -> bool:
    """Whether a value is inside the physical range of a quantity."""
    return quantity.lower <= value <= quantity.upper
