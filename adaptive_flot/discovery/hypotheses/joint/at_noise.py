"""Whether errors are noise from row to row, or those of other records but for outliers: nothing is left to explain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from adaptive_flot.discovery.hypotheses.joint.rows import Rows
from adaptive_flot.discovery.record.robust import memory, without_memory, without_spikes
from adaptive_flot.greybox.model import FloatArray

JUST_ABOVE = 1.05
"""Errors of at most so many times those of the reference are no larger."""
LONGER = 0.1
"""Nor is their memory longer where neighbours are correlated by at most so much more."""


def are_noise(rows: Rows, errors: Sequence[FloatArray]) -> NDArray[np.bool_]:
    """Whether errors of each record (N, m) are noise without a memory, output by output (m,); see `without_memory`."""
    seen = [r.outputs[:, list(rows.columns)] for r in rows.records]
    return without_memory(_that_count(rows, errors), _one_below_the_other(seen))


def are_usual(
    rows: Rows, errors: Sequence[FloatArray], usual_rows: Rows, usual: Sequence[FloatArray]
) -> NDArray[np.bool_]:
    """Whether errors (N, m) are no larger than the usual ones, nor have a longer memory, output by output (m,).

    Values far from their neighbours do not count, here and there.
    """
    new, old = without_spikes(_that_count(rows, errors)), without_spikes(_that_count(usual_rows, usual))
    with np.errstate(all="ignore"):
        size, usual_size = (np.sqrt(np.nanmean(e**2, axis=0)) for e in (new, old))
    found: NDArray[np.bool_] = (size <= JUST_ABOVE * usual_size) & (memory(new) <= memory(old) + LONGER)
    return found


def _that_count(rows: Rows, errors: Sequence[FloatArray]) -> FloatArray:
    """Errors of the rows that count, one record below the other."""
    return _one_below_the_other([np.where(c[:, None], e, np.nan) for e, c in zip(errors, rows.counted, strict=True)])


def _one_below_the_other(series: Sequence[FloatArray]) -> FloatArray:
    """Series (N, m) as one, with a row of NaN after each."""
    gap = np.full((1, series[0].shape[1]), np.nan)
    return np.concatenate([part for one in series for part in (one, gap)])
