"""Fewer points that show the same line, so that a page of a long record stays small and quick."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from adaptive_flot.greybox.quantities import FloatArray

Rows = NDArray[np.int64]


def kept_rows(lines: Sequence[FloatArray], most: int) -> Rows:
    """Rows to keep of lines over one time axis: of each group of rows the lowest and highest of every line.

    Every row kept is one that was measured or computed; nothing is averaged. The first missing value of a group is kept
    too, so that a gap stays a gap.

    Parameters
    ----------
    lines
        Values (N,) each.
    most
        Rows to keep at most; at least 16 are kept.

    Returns
    -------
    ndarray
        Rows in order.

    >>> y = np.sin(np.arange(100_000.0))
    >>> rows = kept_rows([y], 4000)
    >>> len(rows) <= 4000, bool(y[rows].max() == y.max())
    (True, True)
    """
    count = len(lines[0])
    if count <= most:
        return np.arange(count)
    size = -(-count // max(1, (max(most, 16) - 2) // (3 * len(lines))))
    groups = -(-count // size)
    kept = [np.array([0, count - 1])]
    for line in lines:
        padded = np.full(groups * size, np.nan)
        padded[:count] = line
        grid = padded.reshape(groups, size)
        gap = np.isnan(grid)
        start = size * np.arange(groups)
        kept += [start + np.argmin(np.where(gap, np.inf, grid), axis=1)]
        kept += [start + np.argmax(np.where(gap, -np.inf, grid), axis=1)]
        kept += [(start + np.argmax(gap, axis=1))[gap.any(axis=1)]]
    rows = np.unique(np.concatenate(kept))
    return rows[rows < count]


def fair_share(lengths: Sequence[tuple[int, int]], budget: int) -> int:
    """Rows that each group of lines may keep, so that all values together stay within a budget.

    Parameters
    ----------
    lengths
        (rows, values a row) of each group.
    budget
        Values of all groups.

    Returns
    -------
    int
        The same for all; a group that is shorter leaves its rest to the others.

    >>> fair_share([(100, 1), (10_000, 2)], 2100), fair_share([(100, 1)], 2100)
    (1000, 100)
    """
    most = max((rows for rows, _ in lengths), default=0)
    low, high = 0, most
    while low < high:
        middle = (low + high + 1) // 2
        if sum(min(rows, middle) * values for rows, values in lengths) <= budget:
            low = middle
        else:
            high = middle - 1
    return low
