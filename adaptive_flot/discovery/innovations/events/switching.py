"""When something at a site was switched on and off: one size for all times, the times from the innovations.

The response to a switch is that of the steps at its edges, so all pairs of edges are compared through one matrix of
products. Pulses are added, and pauses in them, while they are worth their two times by the Bayesian information
criterion. Then each pulse is taken out and placed anew until none moves. Basseville & Nikiforov (1993), 2.6; Fearnhead
& Rigaill, *J. Am. Stat. Assoc.* 114 (2019) 169, on changes of level that are found in order of their gain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from adaptive_flot.discovery.hypotheses.joint.rows import BoolArray
from adaptive_flot.greybox.model import FloatArray

IntArray = NDArray[np.int_]

MOST_EDGES = 600
"""Most times between which a switch is looked for. A longer record has a coarse grid, then a fine one at the best."""
MOST_PULSES = 8
ROUNDS = 4
"""Rounds in which every pulse is placed anew."""
WORTH = 2.0
"""Gain of a pulse in log-likelihood, in log n: the best of all n^2 / 2 pairs of edges gains about so much by chance."""
SHORTEST = 2
"""Fewest rows of a pulse: a single row is an outlier."""


@dataclass(frozen=True)
class Switch:
    """When it was on, for one site.

    Attributes
    ----------
    pulses
        First interval in which it is on, and first in which it is off again (the number of intervals where it lasts).
    size
        Factor of the course while it is on, as fitted by the regression.
    gain
        Of the log-likelihood over the model without, with the spread of the innovations fitted in both.
    """

    pulses: tuple[tuple[int, int], ...]
    size: float
    gain: float

    def edges(self, count: int) -> IntArray:
        """Intervals before the last in which it is switched, one way or the other."""
        return np.array([e for pulse in self.pulses for e in pulse if e < count], dtype=int)

    def slow(self, count: int) -> FloatArray:
        """The same with edges that take half as long as the pulse, or the pause before it (count,)."""
        course, end = np.zeros(count), 0
        for a, b in self.pulses:
            ends = [n for n in (a - end, b - a) if n]
            width = max(min(ends) // 2, 1)
            pulse = np.zeros(count)
            pulse[a:b] = 1.0
            wide = np.pad(pulse, width, mode="edge")
            course += np.convolve(wide, np.ones(2 * width + 1) / (2 * width + 1), mode="valid")
            end = b
        return course

    def mask(self, count: int) -> FloatArray:
        """1 in the intervals in which it is on, else 0 (count,)."""
        mask = np.zeros(count)
        for a, b in self.pulses:
            mask[a:b] = 1.0
        return mask


def best_switch(steps: FloatArray, edges: IntArray, innovations: FloatArray, count: int) -> Switch | None:
    """Find the switch of one size that explains most; None where none is worth its times.

    Parameters
    ----------
    steps
        Response to steps of the course at each edge (n, g), what the constants explain projected out.
    edges
        First interval of each step, rising (g,).
    innovations
        What is to be explained (n,), projected likewise.
    count
        Number of intervals.
    """
    n = len(innovations)
    G, b = steps.T @ steps, steps.T @ innovations
    total = float(innovations @ innovations)
    G = np.pad(G, (0, 1))  # the last edge is the end of the record: a step that never comes
    b = np.append(b, 0.0)
    ends = np.append(edges, count)
    allowed = (ends[None, :] - ends[:, None]) >= SHORTEST
    search = _Search(G, b, total, n, ends, allowed)
    chosen: list[tuple[int, int]] = []
    best = 0.0
    while len(chosen) < MOST_PULSES:
        pulse, beside = search.best_beside(chosen)
        # two pulses and the pause between them may look like one that is longer and smaller
        parted, inside = search.best_parted(chosen)
        if max(beside, inside) - best < WORTH * np.log(n):
            break
        more = parted if pulse is None or inside > beside else [*chosen, pulse]
        chosen, best = search.settled(more)
    if not chosen:
        return None
    pulses = tuple(sorted((int(ends[i]), int(ends[j])) for i, j in chosen))
    return Switch(pulses, search.size(chosen), best)


@dataclass(frozen=True)
class _Search:
    G: FloatArray
    b: FloatArray
    total: float
    n: int
    ends: IntArray
    allowed: BoolArray

    def _sums(self, chosen: Sequence[tuple[int, int]]) -> tuple[float, float, FloatArray]:
        """Products of the chosen pulses together with the innovations, themselves and every step."""
        c = np.zeros(len(self.b))
        for i, j in chosen:
            c[i] += 1
            c[j] -= 1
        row = self.G @ c
        return float(self.b @ c), float(c @ row), row

    def size(self, chosen: Sequence[tuple[int, int]]) -> float:
        num, den, _ = self._sums(chosen)
        return num / den if den > 0 else 0.0

    def gain(self, chosen: Sequence[tuple[int, int]]) -> float:
        num, den, _ = self._sums(chosen)
        return self._log_gain(num**2 / den if den > 0 else 0.0)

    def _log_gain(self, explained: float) -> float:
        return self.n / 2 * float(np.log(self.total / max(self.total - explained, 1e-9 * self.total)))

    def best_beside(self, chosen: Sequence[tuple[int, int]]) -> tuple[tuple[int, int] | None, float]:
        """The pulse that explains most together with the chosen ones, and the gain of all."""
        free = self.allowed.copy()
        for i, j in chosen:  # no overlap, not even an edge in common
            free &= (self.ends[None, :] < self.ends[i]) | (self.ends[:, None] > self.ends[j])
        return self._best(chosen, free, 1.0)

    def best_parted(self, chosen: Sequence[tuple[int, int]]) -> tuple[list[tuple[int, int]], float]:
        """The chosen pulses with one of them parted by a pause, where that explains most, and the gain of all."""
        ends = self.ends
        free = np.zeros_like(self.allowed)
        for i, j in chosen:
            inner = (ends >= ends[i] + SHORTEST) & (ends <= ends[j] - SHORTEST)
            free |= self.allowed & inner[:, None] & inner[None, :]
        pause, gain = self._best(chosen, free, -1.0)
        if pause is None:
            return list(chosen), 0.0
        a, b = pause
        parted = [p for i, j in chosen for p in (((i, a), (b, j)) if ends[i] < ends[a] < ends[j] else ((i, j),))]
        return parted, gain

    def _best(
        self, chosen: Sequence[tuple[int, int]], free: BoolArray, sign: float
    ) -> tuple[tuple[int, int] | None, float]:
        """The free pair of edges between which one more pulse, or one less, explains most, and the gain of all."""
        if not free.any():
            return None, 0.0
        num, den, row = self._sums(chosen)
        diagonal = np.diag(self.G)
        both = num + sign * (self.b[:, None] - self.b[None, :])
        spread = den + diagonal[:, None] + diagonal[None, :] - 2 * self.G + 2 * sign * (row[:, None] - row[None, :])
        least = 1e-9 * float(diagonal.max() or 1.0)
        explained = np.where(free & (spread > least), both**2 / np.maximum(spread, least), 0.0)
        i, j = divmod(int(np.argmax(explained)), explained.shape[1])
        if not explained[i, j] > 0:
            return None, 0.0
        return (i, j), self._log_gain(float(explained[i, j]))

    def settled(self, chosen: Sequence[tuple[int, int]]) -> tuple[list[tuple[int, int]], float]:
        """Each pulse taken out and placed anew, until none moves."""
        pulses = list(chosen)
        for _ in range(ROUNDS):
            before = list(pulses)
            for k in range(len(pulses)):
                others = pulses[:k] + pulses[k + 1 :]
                placed, _ = self.best_beside(others)
                if placed is not None and self.gain([*others, placed]) > self.gain(pulses):
                    pulses = [*others[:k], placed, *others[k:]]
            if pulses == before:
                break
        return pulses, self.gain(pulses)


def chance_of_edges(rows: IntArray, inputs: FloatArray) -> float:
    """Probability that so many edges of a switch lie beside steps of an input by chance.

    With n edges, k of them within a row of a step, and a share q of all rows that are as near to one::

        P(K >= k),    K ~ Binomial(n, q)

    Parameters
    ----------
    rows
        First row of each state of the switch (n,).
    inputs
        Inputs of the record (N, m), each row's held over the interval that leads to it.

    Returns
    -------
    float
        The smallest of all inputs, times their number; 1 without an edge or an input. An input that moves in each row
        has q = 1, so it tells nothing.
    """
    found = []
    for column in inputs.T:
        near = np.zeros(len(column), dtype=bool)
        steps = 1 + np.flatnonzero(np.diff(column) != 0)
        for shift in (-1, 0, 1):
            near[np.clip(steps + shift, 0, len(column) - 1)] = True
        hits = int(near[rows].sum())
        found.append(float(binom.sf(hits - 1, len(rows), near.mean())))
    return min(1.0, len(found) * min(found)) if found and len(rows) else 1.0
