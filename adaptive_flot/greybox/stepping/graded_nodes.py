"""Instants to simulate a coarsely sampled record at: close together after a move of an input, far apart at rest.

What a move sets off is fast at first and slow later. So the first interval of the record after a move is parted into
several steps, the next ones into fewer, and long after it a step takes several intervals at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.nodes import MOVE, IntArray, Nodes, interpolation

LARGE_MOVE = 0.02
"""Share of an input's range from which a move is followed by short steps; a smaller one only begins a new step."""


@dataclass(frozen=True)
class GradedNodes(Nodes):
    """Rows of a record, or some of them, and instants between.

    `rows` tells the row at or before each instant.

    Attributes
    ----------
    ends
        Row at or after the end of each interval (M - 1,).
    every_row
        Nodes that leave no row out; None where these leave none out.
    """

    ends: IntArray
    every_row: GradedNodes | None

    def means(self, values: FloatArray) -> FloatArray:
        """Means (M - 1, ...) over the rows that end in each interval, or of the row it lies in; values (N, ...)."""
        sums = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
        count = (self.ends - self.rows[:-1]).reshape(-1, *(1,) * (values.ndim - 1))
        means: FloatArray = (sums[self.ends + 1] - sums[self.rows[:-1] + 1]) / count
        return means


def graded_nodes(
    record: Dataset,
    first: int,
    least: int = 1,
    longest: int = 1,
    growth: float = 0.0,
    every_row: GradedNodes | None = None,
) -> GradedNodes:
    """Nodes of a record: `first` steps in the interval after a large move, `first` / 2 in the next, `first` / 3, ...

    They do not fall below `least`. Where one step an interval is reached, steps grow by `growth` intervals an interval,
    up to `longest` of them. No step reaches across a move.

    Parameters
    ----------
    record
        The record.
    first, least, longest, growth
        As above.
    every_row
        Nodes that leave no row out, to be kept with those that do.
    """
    n, change = len(record), np.abs(np.diff(record.inputs, axis=0)) / np.maximum(np.ptp(record.inputs, axis=0), 1e-300)
    # the inputs of row k are held in the interval that ends there: a move in row k begins at the row before it
    borders = np.union1d(np.flatnonzero((change > MOVE).any(axis=1)), [0, n - 1])
    large = set(np.flatnonzero((change > LARGE_MOVE).any(axis=1)).tolist()) | {0}
    rows, fractions, ends, row, since = [0], [0.0], list[int](), 0, 0
    for border in borders[1:].tolist():
        since = 0 if row in large else since
        while row < border:
            steps = max(least, math.ceil(first / (since + 1)))
            taken = min(longest, 1 + int(growth * (since - first)), border - row) if since > first and steps == 1 else 1
            rows += [row] * (steps - 1)
            fractions += [k / steps for k in range(1, steps)]
            ends += [row + taken] * steps
            row, since = row + taken, since + taken
            rows.append(row)
            fractions.append(0.0)
    at, share = np.array(rows, dtype=np.intp), np.array(fractions)
    times = record.time[0] + record.dt * (at + share)
    weights = _weights(at, share, borders, n)
    nodes = GradedNodes(at, times, np.empty(0), weights, np.array(ends, dtype=np.intp), every_row)
    return replace(nodes, inputs=np.column_stack([nodes.means(record.inputs), np.diff(times)]))


def _weights(at: IntArray, share: FloatArray, borders: IntArray, n: int) -> csr_array:
    """Weights (N, M) of the nodes that are rows in every row: interpolated between two borders, never across one."""
    on = np.flatnonzero(share == 0.0)
    known = at[on]
    weight, row, node = [np.ones(len(on))], [known], [on]
    places = np.searchsorted(known, borders)
    for start, stop in pairwise(places):
        if known[stop] - known[start] > stop - start:  # rows are left out
            w, r, c = interpolation(known[start : stop + 1], 0)
            between = ~np.isin(r, known)
            weight.append(w[between])
            row.append(r[between])
            node.append(on[start + c[between]])
    return csr_array((np.concatenate(weight), (np.concatenate(row), np.concatenate(node))), shape=(n, len(at)))
