"""A function that hands part of its results on to its next call, over all rows in one call of machine code."""

from __future__ import annotations

import ctypes
from collections.abc import Collection, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiled import load_library
from adaptive_flot.greybox.stepping.whole_record.library import LIBRARY_FLAGS, TapeStruct
from adaptive_flot.greybox.stepping.whole_record.source import RECURSION_SOURCE
from adaptive_flot.greybox.stepping.whole_record.tape import tape_of


class TapeRecursion:
    """Calls a function for K rows, each with what the one before left, from its tape: no compiler for each function.

    Parameters
    ----------
    function
        An SX function, the carried arguments first, and their next values the first results, in the same order.
    carried
        Number of carried arguments.
    held
        Names of arguments that are the same in all rows: what depends on them alone is worked out once.

    Raises
    ------
    CompileError
        The library can not be compiled or loaded, or the function has an operation that it does not know.
    """

    def __init__(self, function: ca.Function, carried: int, held: Collection[str]) -> None:
        self._names = [function.name_in(i) for i in range(function.n_in())]
        self._results = [function.name_out(i) for i in range(function.n_out())]
        self._shapes = [function.size_in(i) for i in range(function.n_in())]
        self._sizes = np.array([function.numel_in(i) for i in range(function.n_in())], dtype=np.int64)
        self._widths = np.array([function.numel_out(i) for i in range(function.n_out())], dtype=np.int64)
        self._carried, self._held = carried, frozenset(held)
        self._tape = tape_of(function, [i for i, name in enumerate(self._names) if name in held])
        self._run = _library()

    def __call__(self, carried: Mapping[str, FloatArray], each: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Evaluate.

        Parameters
        ----------
        carried
            Carried arguments before the first row, (n,) or (n, m).
        each
            The other arguments, a row each (K, n) or the same for all (n,); those that are held are the latter.

        Returns
        -------
        dict
            Results by name: (K, n), or (K, n, m) of a carried matrix.
        """
        values = {**carried, **each}
        given = [self._columns(name, values[name]) for name in self._names]
        rows = max((len(a) for a in given if a.ndim == 2), default=1)
        for name, size, a in zip(self._names, self._sizes, given, strict=True):
            if a.shape[-1] != size or (a.ndim == 2 and (len(a) != rows or name in self._held)):
                raise ValueError(f"{name}: shape {values[name].shape} does not fit {rows} rows of {size}")
        strides = np.array([a.shape[1] if a.ndim == 2 else 0 for a in given], dtype=np.int64)
        made = [np.empty((rows, width)) for width in self._widths]
        memory = self._tape.memory.copy()  # so that threads may run at once
        tape = TapeStruct(self._tape, memory, None, None)
        self._run(
            ctypes.byref(tape), rows, len(given), self._carried, self._sizes.ctypes.data, _addresses(given),
            strides.ctypes.data, len(made), self._widths.ctypes.data, _addresses(made),
        )  # fmt: skip
        found = dict(zip(self._results, made, strict=True))
        for name, result, shape in zip(self._names[: self._carried], self._results, self._shapes, strict=False):
            if values[name].ndim == 2:  # CasADi's matrices go by columns
                found[result] = found[result].reshape(rows, shape[1], shape[0]).transpose(0, 2, 1)
        return found

    def _columns(self, name: str, value: FloatArray) -> FloatArray:
        """An argument as the tape has it: a carried matrix column by column."""
        flat = value.ravel(order="F") if name in self._names[: self._carried] else value
        return np.ascontiguousarray(flat, dtype=float)


def _addresses(arrays: Sequence[FloatArray]) -> Any:
    return (ctypes.c_void_p * len(arrays))(*(a.ctypes.data for a in arrays))


@lru_cache(maxsize=1)
def _library() -> Any:
    return load_library("recursion", RECURSION_SOURCE, LIBRARY_FLAGS, _open)


def _open(library: Path) -> Any:
    recur = ctypes.CDLL(str(library)).recur
    pointer, whole = ctypes.c_void_p, ctypes.c_int64
    recur.argtypes = [pointer, whole, whole, whole, pointer, pointer, pointer, whole, pointer, pointer]
    recur.restype = None
    return recur
