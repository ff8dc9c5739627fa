"""Instants to simulate a record at, where its rows are too many or too few.

Fewer in a densely sampled record: close together after a move of an input, far apart else. Between two moves of the
inputs everything is smooth, and a record sampled every second says most things several times. The free run steps from
node to node; the rows between are interpolated by cubics that never reach across a move. More in a coarsely sampled
record, where an interval asks for several steps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.step_functions import Interval
from adaptive_flot.greybox.stepping.stepper import Stepper

MOVE = 0.001
"""An input that changes from one row to the next by more than this share of its range has moved."""
STENCIL = 4
"""Nodes that a row between them is interpolated from."""

IntArray = NDArray[np.intp]


@dataclass(frozen=True)
class Nodes:
    """Rows of a record that are simulated, and how the other rows follow from them.

    Attributes
    ----------
    rows
        Rows (M,), the first and the last of the record among them.
    times
        Their times (M,) [s].
    inputs
        Mean inputs (M - 1, nu) of each interval and, as the last column, its length [s].
    weights
        Weights (N, M) of the nodes in each row, sparse.
    """

    rows: IntArray
    times: FloatArray
    inputs: FloatArray
    weights: csr_array

    def spread(self, values: FloatArray, rows: IntArray | None = None) -> FloatArray:
        """Values at all rows (N, ...), or at some of them, from values at the nodes (M, ...)."""
        weights = self.weights if rows is None else self.weights[rows]
        spread: FloatArray = weights @ values.reshape(len(values), -1)
        return spread.reshape(len(spread), *values.shape[1:])

    def means(self, values: FloatArray) -> FloatArray:
        """Means (M - 1, ...) over the rows of each interval, the row at its end among them; values (N, ...)."""
        sums: FloatArray = np.add.reduceat(values[1:], self.rows[:-1], axis=0)
        return sums / np.diff(self.rows).reshape(-1, *(1,) * (values.ndim - 1))


class Substeps(Nodes):
    """All rows of a record, and instants between each two; `rows` tells the row at or before each."""

    def means(self, values: FloatArray) -> FloatArray:
        """What is held in each interval (M - 1, ...), the values of the row at its end; values (N, ...)."""
        held: FloatArray = values[1:][self.rows[:-1]]
        return held


def substeps(record: Dataset, count: int) -> Substeps:
    """Nodes that part each interval between two rows into `count` equal ones."""
    n = len(record)
    each = np.full(n - 1, count, dtype=np.intp)
    ends = np.concatenate([[0], np.cumsum(each)])
    rows = np.append(np.repeat(np.arange(n - 1), each), n - 1)
    fraction = (np.arange(ends[-1] + 1) - ends[rows]) / np.append(each, 1)[rows]
    times = record.time[0] + record.dt * (rows + fraction)
    inputs = np.column_stack([np.repeat(record.inputs[1:], each, axis=0), np.repeat(record.dt / each, each)])
    weights = csr_array((np.ones(n), (np.arange(n), ends)), shape=(n, len(rows)))
    return Substeps(rows, times, inputs, weights)


def place_nodes(record: Dataset, longest: int, growth: float = 0.5) -> Nodes:
    """Nodes of a record, one row apart after a move and further by `growth` rows a row since, up to `longest` rows."""
    u, parts = record.inputs, rows_between_moves(record, longest, growth)
    rows = np.concatenate(parts)
    offsets = np.cumsum([0, *map(len, parts[:-1])])
    triplets = [interpolation(part, offset) for part, offset in zip(parts, offsets, strict=True)]
    weight, row, node = (np.concatenate(c) for c in zip(*triplets, strict=True))
    weights = csr_array((weight, (row, node)), shape=(len(u), len(rows)))
    nodes = Nodes(rows, record.time[rows], np.empty(0), weights)
    return replace(nodes, inputs=np.column_stack([nodes.means(u), np.diff(rows) * record.dt]))


def rows_between_moves(record: Dataset, longest: int, growth: float) -> list[IntArray]:
    """Rows that are nodes, an array from each move of an input to the row before the next; see `place_nodes`."""
    u = record.inputs
    moved = np.zeros(len(u), dtype=bool)
    moved[1:] = (np.abs(np.diff(u, axis=0)) > MOVE * np.ptp(u, axis=0)).any(axis=1)
    moved[0] = True
    starts = np.flatnonzero(moved)
    return [_segment(int(a), int(b), longest, growth) for a, b in zip(starts, [*starts[1:], len(u)], strict=True)]


def _segment(start: int, stop: int, longest: int, growth: float) -> IntArray:
    """Nodes of the rows start to stop - 1, between which no input moves; both ends are nodes."""
    rows = [start]
    while rows[-1] < stop - 1:
        gap = 1 + int(growth * (rows[-1] - start))
        rows.append(min(rows[-1] + min(gap, longest), stop - 1))
    return np.array(rows if len(rows) >= STENCIL else range(start, stop), dtype=np.intp)


def interpolation(nodes: IntArray, offset: int) -> tuple[FloatArray, IntArray, IntArray]:
    """Weights of the nodes in the rows from the first to the last node of a segment: Lagrange's polynomials.

    As weight, row and node of each entry; the first node of the segment is the one numbered `offset`.
    """
    count = min(STENCIL, len(nodes))
    between = np.setdiff1d(np.arange(nodes[0], nodes[-1] + 1), nodes)
    first = np.clip(np.searchsorted(nodes, between) - count // 2, 0, len(nodes) - count)
    stencil = first[:, None] + np.arange(count)
    at = nodes[stencil].astype(float)
    weights, columns = [np.ones(len(nodes))], [np.arange(len(nodes))]
    for k in range(count):
        others = np.delete(at, k, axis=1)
        weights.append(np.prod((between[:, None] - others) / (at[:, k, None] - others), axis=1))
        columns.append(stencil[:, k])
    rows = [nodes, *[between] * count]
    return np.concatenate(weights), np.concatenate(rows), np.concatenate(columns) + offset


class NodeStepper(Stepper):
    """The step of a model with its length as a last input; one Runge-Kutta step an interval.

    Its functions take u as the inputs and, as the last entry, the length of the step [s].
    """

    def __init__(self, model: Model) -> None:
        super().__init__(model, 1.0, substeps=1)
        self.interval = Interval(None, 1)

    def _input_columns(self) -> int:
        return super()._input_columns() + 1

    def _tables(
        self, inputs: FloatArray, parameters: FloatArray | None, t0: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        u, p, _ = super()._tables(inputs, parameters, t0)
        return u, p, t0 + np.concatenate([[0.0], np.cumsum(u[:-1, -1])])
