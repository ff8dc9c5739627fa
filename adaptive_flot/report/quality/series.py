"""From an imported record to what the figures draw."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from adaptive_flot.charts.plotdata import Panel, Role, Strip, Trace
from adaptive_flot.greybox.quantities import FloatArray
from adaptive_flot.records.grid import MEASURED, STATUSES, Codes
from adaptive_flot.records.importing import Imported

GAP = "no rows"
"""What a strip says between two stretches."""
MOST_SPELLS = 600
"""Parts of a strip, beyond which the most frequent status of each part is drawn."""


def panels(imported: Imported) -> list[Panel]:
    """A panel a quantity: the values of the record, a break at each gap."""
    rows = imported.rows
    time = (rows.time - rows.time[0]) / 1e9
    found = []
    for c in imported.cleaned:
        name = c.quantity.name
        t, values = _broken(time, rows.values[name], rows.stretch)
        trace = Trace("", t, values, Role.ESTIMATE, held=imported.is_input(name))
        found.append(Panel(name.replace("_", " "), c.quantity.unit, (trace,), height=0.6))
    return found


def strips(imported: Imported) -> list[Strip]:
    """A strip a quantity: how each row came about."""
    rows = imported.rows
    time = (rows.time - rows.time[0]) / 1e9
    size = max(1, -(-len(time) // MOST_SPELLS))
    edges = [0, *(np.flatnonzero(np.diff(rows.stretch)) + 1).tolist(), len(time)]
    found = []
    for c in imported.cleaned:
        status, ends, words = rows.statuses[c.quantity.name], [np.empty(0)], []
        for a, b in pairwise(edges):
            if a:
                ends.append(time[a : a + 1] - rows.step / 1e9)
                words.append(GAP)
            ends.append(time[np.minimum(np.arange(a, b, size) + size, b) - 1])
            words += [STATUSES[k] for k in _most_frequent(status[a:b], size)]
        found.append(Strip(c.quantity.name.replace("_", " "), np.concatenate(ends), words, STATUSES[MEASURED]))
    return found


def _broken(
    time: FloatArray, values: FloatArray, stretch: np.ndarray[tuple[int], np.dtype[np.int64]]
) -> tuple[FloatArray, FloatArray]:
    """Times and values with an empty value at each gap, so that no line crosses it."""
    gaps = np.flatnonzero(np.diff(stretch)) + 1
    return np.insert(time, gaps, (time[gaps - 1] + time[gaps]) / 2), np.insert(values, gaps, np.nan)


def _most_frequent(status: Codes, size: int) -> list[int]:
    """Of each group of rows the status that most deserves to be seen: the rarest of those that make up a fifth."""
    if size == 1:
        return [int(k) for k in status]
    found = []
    for start in range(0, len(status), size):
        counts = np.bincount(status[start : start + size], minlength=len(STATUSES))
        found.append(int(np.flatnonzero(counts >= 0.2 * counts.sum())[-1]))
    return found
