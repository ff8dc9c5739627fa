"""A function for many members side by side, over many rows in one call."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Mapping, Sequence

import casadi as ca
import numpy as np

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.ensemble.lane_library import LaneLibrary
from adaptive_flot.greybox.ensemble.loop_library import LoopLibrary
from adaptive_flot.greybox.function_cache import FunctionCache
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.compiled import CompileError, CompileWarning
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.greybox.stepping.rows import over_rows
from adaptive_flot.greybox.stepping.whole_record.instruction_sets import InstructionSet


class Lanes:
    """Calls `function` for M members and K rows, each row with what the row before left of the same member.

    Compiled, the members are the lanes of vector registers, and blocks of them go to several threads. A member's
    results do not depend, to the bit, on what members are beside it. Else CasADi's `map` takes all members of a row.

    Parameters
    ----------
    function
        An SX function with dense arguments; with `one_by_one` any function with dense arguments.
    carried
        Result that takes the place of each carried argument in the next row, by the argument's name.
    matrices
        Names of arguments and results that are matrices (n, m) also where m is 1; a column is else a vector (n,).
    as_machine_code
        Compile it; where that can not be done a `CompileWarning` says why.
    instructions
        Instruction set of the machine code; default the widest of this machine.
    one_by_one
        The machine code takes one member after the other, in threads: for a function that is too large for lanes.

    Raises
    ------
    ModelError
        A carried name is not one of the function's, or the result has another shape than the argument.
    """

    def __init__(
        self,
        function: ca.Function,
        carried: Mapping[str, str],
        matrices: Collection[str] = (),
        *,
        as_machine_code: bool = False,
        instructions: InstructionSet | None = None,
        one_by_one: bool = False,
    ) -> None:
        arguments, results = function.name_in(), function.name_out()
        unknown = [*(set(carried) - set(arguments)), *(set(carried.values()) - set(results))]
        if unknown:
            raise ModelError(f"{function.name()}: has no {unknown[0]!r} to carry")
        for taken, given in carried.items():
            if function.size_in(taken) != function.size_out(given):
                raise ModelError(
                    f"{function.name()}: {given!r} {function.size_out(given)} can not take the place of {taken!r} "
                    f"{function.size_in(taken)}; carry a result of its shape"
                )
        self.function = function
        if not one_by_one:
            symbols = function.sx_in()
            values = [ca.densify(value) for value in function.call(symbols)]
            self.function = ca.Function(function.name(), symbols, values, arguments, results, {"cse": True})
        self._carried = [results.index(carried[name]) if name in carried else -1 for name in arguments]
        f, keep = self.function, set(matrices)
        self._in = {n: _shape(f.size_in(i), n in keep) for i, n in enumerate(arguments)}
        self._out = {n: _shape(f.size_out(i), n in keep) for i, n in enumerate(results)}
        self._maps: FunctionCache[FastCall] = FunctionCache(8)
        self.library: LaneLibrary | None = None
        if as_machine_code:
            try:
                self.library = (
                    LoopLibrary(function, self._carried)
                    if one_by_one
                    else LaneLibrary(self.function, self._carried, instructions)
                )
            except CompileError as failure:
                warnings.warn(f"{function.name()} is not compiled: {failure}", CompileWarning, stacklevel=2)

    def __call__(
        self,
        members: int,
        rows: int,
        fixed: Mapping[str, FloatArray],
        by_row: Mapping[str, FloatArray],
        *,
        every: Collection[str] = (),
        last: Collection[str] = (),
    ) -> dict[str, FloatArray]:
        """Evaluate.

        Parameters
        ----------
        members, rows
            Numbers of both, M and K.
        fixed
            Arguments that are the same in every row, and the carried ones before the first row: (n,) or (n, m) for all
            members, or one each, (M, n) or (M, n, m).
        by_row
            Arguments that change from row to row: (K, n) or (K, n, m) for all members, or (M, K, n) or (M, K, n, m).
        every, last
            Names of the results wanted at every row, and after the last row only.

        Returns
        -------
        dict
            Results by name, (M, K, n) or (M, K, n, m); those after the last row without the axis of the rows.

        Raises
        ------
        ModelError
            An argument is missing or has the wrong shape.
        """
        missing = [name for name in self._in if name not in fixed and name not in by_row]
        if missing:
            raise ModelError(f"{self.function.name()}: the argument {missing[0]!r} is not given; give it")
        arguments = [
            self._table(name, by_row[name], members, rows)
            if name in by_row
            else self._table(name, fixed[name], members)
            for name in self._in
        ]
        arguments = [np.broadcast_to(a, (rows, a.shape[1], members)) for a in arguments]
        results = [self._room(name, members, rows if name in every else 1 if name in last else 0) for name in self._out]
        if rows and members:
            if self.library is None:
                self._by_rows(arguments, results, members, rows)
            else:
                self.library(arguments, results, members, rows)
        found = {name: self._seen(name, r) for name, r in zip(self._out, results, strict=True) if r is not None}
        return {name: value if name in every else value[:, 0] for name, value in found.items()}

    def _table(self, name: str, value: FloatArray, members: int, rows: int | None = None) -> FloatArray:
        """An argument as (rows or 1, entries, members or 1)."""
        wanted, given = self._in[name], np.asarray(value, dtype=float)
        each = wanted if rows is None else (rows, *wanted)
        if given.shape not in (each, (members, *each)):
            raise ModelError(
                f"{self.function.name()}: the argument {name!r} has the shape {given.shape}; give {each}, or one for "
                f"each member, {(members, *each)}"
            )
        if len(wanted) == 2:  # CasADi stores matrices by columns
            given = given.swapaxes(-1, -2)
        per_member = given.reshape(-1 if given.size else 1, 1 if rows is None else rows, int(np.prod(wanted)))
        return per_member.transpose(1, 2, 0)

    def _room(self, name: str, members: int, rows: int) -> FloatArray | None:
        """Place for a result (rows, entries, members); members innermost, as they are computed."""
        return np.empty((rows, int(np.prod(self._out[name])), members)) if rows else None

    def _seen(self, name: str, value: FloatArray) -> FloatArray:
        """A result as the caller sees it (M, K, n) or (M, K, n, m)."""
        shape, (rows, _, members) = self._out[name], value.shape
        if len(shape) == 1:
            return value.transpose(2, 0, 1)
        return value.reshape(rows, shape[1], shape[0], members).transpose(3, 0, 2, 1)

    def _by_rows(
        self, arguments: Sequence[FloatArray], results: Sequence[FloatArray | None], members: int, rows: int
    ) -> None:
        """By CasADi's `map`: the members of a row side by side, row by row."""
        names = (*self._in, *self._out)
        call = self._maps.get(members, lambda: FastCall(over_rows(self.function, members), names))
        widths = [self.function.size2_in(i) for i in range(self.function.n_in())]
        found: tuple[FloatArray, ...] = ()
        for row in range(rows):
            now = [
                found[c] if row and c >= 0 else _beside(a[row], width)
                for a, width, c in zip(arguments, widths, self._carried, strict=True)
            ]
            found = call(*now)
            for result, value in zip(results, found, strict=True):
                if result is not None and (len(result) == rows or row == rows - 1):
                    kept = result[row if len(result) == rows else 0]
                    each = value.reshape(len(value), members, value.shape[1] // members)
                    kept[...] = each.transpose(2, 0, 1).reshape(kept.shape)


def _shape(size: tuple[int, int], matrix: bool) -> tuple[int, ...]:
    return size if size[1] != 1 or matrix else (size[0],)


def _beside(value: FloatArray, width: int) -> FloatArray:
    """Matrices of the members side by side (n, M m), from their entries by columns (n m, M)."""
    entries, members = value.shape
    return value.reshape(width, entries // width, members).transpose(1, 2, 0).reshape(entries // width, members * width)
