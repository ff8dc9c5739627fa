"""A function that hands part of its results on to its next call, over many rows in one call."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.fastcall import FastCall

NESTED = 10
"""Rows a level of CasADi's nested loops takes."""


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
        arguments = {function.name_in(i): a for i, a in enumerate(function.sx_in())}
        results = {function.name_out(i): r for i, r in enumerate(function.call(function.sx_in()))}
        unknown = [*(set(carried) - set(arguments)), *(set(carried.values()) - set(results))]
        if unknown:
            raise ModelError(f"{function.name()}: has no {unknown[0]!r} to carry")
        self.rows = rows
        self._carried, self._pairs = tuple(carried), dict(carried)
        self._each = tuple(name for name in arguments if name not in carried)
        self._results = (*carried.values(), *(name for name in results if name not in carried.values()))
        names = (*self._carried, *self._each)
        ordered = ca.Function(
            function.name(),
            [arguments[name] for name in names],
            [ca.densify(results[name]) for name in self._results],
            names,
            self._results,
            {"cse": True},
        )
        # the number of carried arguments must be said: CasADi carries only the first one else
        loop = ordered.mapaccum(f"{function.name()}_x{rows}", rows, len(carried), {"base": NESTED})
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
        return value.reshape(len(value), self.rows, -1).transpose(1, 0, 2) if matrix else value.T
