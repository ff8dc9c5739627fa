"""Candidate test signals: steps, square waves and pseudo-random binary sequences of the inputs, inside limits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import max_len_seq

from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.quantities import Quantity

LOW, HIGH = 0.02, 0.98
"""Quantiles of the record between which a test moves an input: where the process has been run already."""
SETTLE = 0.1
"""Share of a test before its first step."""
PERIODS = (2, 6)
"""Periods of the square waves of a test."""
REGISTER = 5
"""Bits of the shift register of the binary sequence: 31 moves at most."""

WATCHING = "no move"


@dataclass(frozen=True)
class TestSignal:
    """Inputs (N, nu) held in each interval of a test, and the test in words."""

    __test__ = False  # not a test case, whatever pytest makes of the name

    name: str
    inputs: FloatArray


@dataclass(frozen=True)
class Range:
    """Lowest value, value at rest and highest value of each input in a test, (nu,) each."""

    low: FloatArray
    rest: FloatArray
    high: FloatArray

    def without_moves(self, held: Sequence[int]) -> Range:
        """The same, with some inputs kept at rest."""
        low, high = self.low.copy(), self.high.copy()
        low[list(held)] = high[list(held)] = self.rest[list(held)]
        return Range(low, self.rest, high)


def input_range(
    inputs: FloatArray, quantities: Sequence[Quantity], limits: Mapping[str, tuple[float, float]] | None = None
) -> Range:
    """Where a test may move the inputs: between the limits given, else where the record (N, nu) has been.

    Raises
    ------
    ModelError
        A limit names no input, or its ends are not in order or outside the physical range of the input.
    """
    low, rest, high = np.quantile(inputs, [LOW, 0.5, HIGH], axis=0)
    names = [q.name for q in quantities]
    for name, (a, b) in (limits or {}).items():
        if name not in names:
            raise ModelError(f"limit of {name!r}: the model has no such input; {near_match(name, names)}")
        j = names.index(name)
        q = quantities[j]
        if not q.lower <= a < b <= q.upper:
            raise ModelError(
                f"limit of {name!r}: {a:g} to {b:g} {q.unit}; give two values in order, inside [{q.lower:g}, "
                f"{q.upper:g}] {q.unit}"
            )
        low[j], high[j] = a, b
    return Range(low, np.clip(rest, low, high), high)


def candidate_tests(names: Sequence[str], where: Range, rows: int) -> Iterator[TestSignal]:
    """Tests of each input that may move, the others at rest, and one that moves all of them at once.

    Parameters
    ----------
    names
        Names of the inputs.
    where
        Their ranges.
    rows
        Intervals of a test.
    """
    moving = [j for j in range(len(names)) if where.high[j] > where.low[j]]
    at_rest = np.tile(where.rest, (rows, 1))
    for j in moving:
        words = names[j].replace("_", " ")
        ends = ("low", where.low[j]), ("high", where.high[j])
        for word, level in ends:
            u = at_rest.copy()
            u[round(SETTLE * rows) :, j] = level
            if level != where.rest[j]:
                yield TestSignal(f"step of {words} to its {word} end", u)
        for periods in PERIODS:
            yield TestSignal(
                f"square wave of {words}, {periods} periods", _moved(at_rest, where, {j: _square(rows, periods)})
            )
        yield TestSignal(f"binary sequence of {words}", _moved(at_rest, where, {j: _binary(rows)}))
    if len(moving) > 1:
        profiles = {j: _binary(rows, k, len(moving)) for k, j in enumerate(moving)}
        words = ", ".join(names[j].replace("_", " ") for j in moving)
        yield TestSignal(f"binary sequences of {words} at once", _moved(at_rest, where, profiles))


def watching(last: FloatArray, rows: int) -> TestSignal:
    """The test that moves nothing: the `last` inputs (nu,) of the record are held, which shows what waiting tells."""
    return TestSignal(WATCHING, np.tile(last, (rows, 1)))


def _moved(at_rest: FloatArray, where: Range, profiles: Mapping[int, FloatArray]) -> FloatArray:
    u = at_rest.copy()
    for j, high in profiles.items():
        u[:, j] = np.where(high > 0, where.high[j], where.low[j])
    return u


def _square(rows: int, periods: int) -> FloatArray:
    halves = np.arange(rows) * 2 * periods // rows
    return np.where(halves % 2 == 0, 1.0, 0.0)


def _binary(rows: int, place: int = 0, count: int = 1) -> FloatArray:
    """Maximum-length sequence over the test; several inputs get it turned by equal shares, which keeps them apart."""
    bits = max_len_seq(REGISTER)[0]
    turned = np.roll(bits, place * len(bits) // count)
    levels: FloatArray = turned[np.arange(rows) * len(bits) // rows].astype(float)
    return levels
