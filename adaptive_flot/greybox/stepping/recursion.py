"""A function that hands part of its results on to its next call, over many rows in one call."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping

import casadi as ca
import numpy as np

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.compiled import CompileError
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.greybox.stepping.whole_record.tape_recursion import TapeRecursion

NESTED = 10
"""Rows a level of CasADi's nested loops takes."""
CHUNK = 100
"""Rows of one call of CasADi."""
RowByRow = Callable[[Mapping[str, FloatArray], Mapping[str, FloatArray]], dict[str, FloatArray]]


def row_by_row(function: ca.Function, carried: Mapping[str, str], held: Collection[str]) -> RowByRow:
    """Calls of a function for any number of rows, each with what the one before left.

    From its tape in machine code, or by CasADi where there is no compiler: the numbers are the same.

    Parameters
    ----------
    function, carried
        As `Recursion` has them.
    held
        Names of arguments that are the same in all rows.

    Returns
    -------
    callable
        ``(carried, each) -> results``, see `Recursion`; any number of rows K >= 1.

    Raises
    ------
    ModelError
        A carried name is not one of the function's.
    """
    try:
        return TapeRecursion(ordered(function, carried), len(carried), held)
    except CompileError:
        return _InChunks(Recursion(function, carried, CHUNK), carried)


class _InChunks:
    """Any number of rows by calls for so many at a time; the last call goes on with its last row, which is left out."""

    def __init__(self, recursion: Recursion, carried: Mapping[str, str]) -> None:
        self._recursion, self._carried = recursion, carried

    def __call__(self, carried: Mapping[str, FloatArray], each: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        size = self._recursion.rows
        count = max((len(a) for a in each.values() if a.ndim == 2), default=1)
        take = np.minimum(np.arange(math.ceil(count / size) * size), count - 1)
        parts, at = list[dict[str, FloatArray]](), dict(carried)
        for start in range(0, len(take), size):
            rows = take[start : start + size]
            part = self._recursion(at, {k: a[rows] if a.ndim == 2 else a for k, a in each.items()})
            at = {name: part[result][-1] for name, result in self._carried.items()}
            parts.append(part)
        return {k: np.concatenate([part[k] for part in parts])[:count] for k in parts[0]}


def ordered(function: ca.Function, carried: Mapping[str, str]) -> ca.Function:
    """The function with carried arguments and results first, in the same order, and dense results.

    Raises
    ------
    ModelError
        A carried name is not one of the function's.
    """
    arguments = {function.name_in(i): a for i, a in enumerate(function.sx_in())}
    results = {function.name_out(i): r for i, r in enumerate(function.call(function.sx_in()))}
    unknown = [*(set(carried) - set(arguments)), *(set(carried.values()) - set(results))]
    if unknown:
        raise ModelError(f"{function.name()}: has no {unknown[0]!r} to carry")
    names = (*carried, *(name for name in arguments if name not in carried))
    told = (*carried.values(), *(name for name in results if name not in carried.values()))
    return ca.Function(
        function.name(),
        [arguments[n] for n in names],
        [ca.densify(results[n]) for n in told],
        names,
        told,
    )


class Recursion:
    """Calls `function` for K rows, each with what the one before left: a loop without Python between the rows.

    Parameters
    ----------
    function
        An SX function with column vectors; what is carried may be a matrix (n, m).
    carried
        Result that takes the place of each carried argument in the next row, by the argument's name.
    rows
        K.
    as_machine_code
        Compile it, loop and all.

    Raises
    ------
    ModelError
        A carried name is not one of the function's.
    """

    def __init__(
        self, function: ca.Function, carried: Mapping[str, str], rows: int, *, as_machine_code: bool = False
    ) -> None:
        each = ordered(function, carried)
        names = tuple(each.name_in(i) for i in range(each.n_in()))
        self.rows = rows
        self._carried, self._pairs = tuple(carried), dict(carried)
        self._each, self._results = names[len(carried) :], tuple(each.name_out(i) for i in range(each.n_out()))
        # the number of carried arguments must be said: CasADi carries only the first one else
        loop = each.mapaccum(f"{function.name()}_x{rows}", rows, len(carried), {"base": NESTED})
        self._call = FastCall(loop, matrices=(*names, *self._results), as_machine_code=as_machine_code)

    def __call__(self, carried: Mapping[str, FloatArray], each: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Evaluate.

        Parameters
        ----------
        carried
            Carried arguments before the first row, (n,) or (n, m).
        each
            The other arguments, a row each (K, n) or the same for all (n,).

        Returns
        -------
        dict
            Results by name, (K, n) or (K, n, m).
        """
        first = [carried[name] if carried[name].ndim == 2 else carried[name][:, None] for name in self._carried]
        tables = [each[name].T if each[name].ndim == 2 else self._repeat(each[name]) for name in self._each]
        results = self._call(*first, *tables)
        square = {result for name, result in self._pairs.items() if carried[name].ndim == 2}
        return {n: self._by_rows(value, n in square) for n, value in zip(self._results, results, strict=True)}

    def _repeat(self, value: FloatArray) -> FloatArray:
        return value[:, None].repeat(self.rows, axis=1)

    def _by_rows(self, value: FloatArray, matrix: bool) -> FloatArray:
        return value.reshape(len(value), self.rows, -1).transpose(1, 0, 2) if matrix else value.T.reshape(self.rows, -1)
