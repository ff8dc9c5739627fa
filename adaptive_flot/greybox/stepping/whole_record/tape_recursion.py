"""A function that hands part of its results on to its next call, over all rows in one call of machine code."""

from __future__ import annotations

import ctypes
from collections.abc import Collection, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.compiled import CompileError, is_kept, load_library
from adaptive_flot.greybox.stepping.whole_record.instruction_sets import AVX2, AVX512, SCALAR, supported
from adaptive_flot.greybox.stepping.whole_record.library import KERNEL_FLAGS, LIBRARY_FLAGS, TapeStruct
from adaptive_flot.greybox.stepping.whole_record.source import (
    RECURSION_SOURCE,
    kernel_source,
    kernel_source_in_lanes,
    recursion_in_lanes,
)
from adaptive_flot.greybox.stepping.whole_record.tape import Tape, tape_of

LANES = 8
"""Members side by side: their numbers fill one register of AVX-512, and the time of reading the tape is shared."""
_VECTORS = {
    SCALAR.name: (),
    AVX2.name: ("-mavx2",),
    AVX512.name: ("-mavx512f", "-mprefer-vector-width=512"),
}
"""Sums and products alone are vector instructions, none of which is contracted: the numbers are those of one member."""
WORTH_COMPILING = 50_000
"""Rows from which a function is compiled, for one member or for several. By tape a row takes some 2 ns an operation
longer, with several members 5 ns, and the compiler takes 100 to 250 us an operation."""
_QUICK = ("-Og", "-fno-tree-slp-vectorize", "-ffp-contract=off", "-fno-builtin-pow", "-Wno-psabi", "-fPIC", "-shared")
"""Vectors gain little by a compiler that takes longer."""


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
        self._rows: dict[int, int] = {}
        self._compiled: dict[int, tuple[int | None, int | None]] = {}

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
        given, rows, strides = self._given(values)
        made = [np.empty((rows, width)) for width in self._widths]
        memory = self._tape.memory.copy()  # so that threads may run at once
        tape = TapeStruct(self._tape, memory, *self._machine_code(rows, 1))
        self._run(
            ctypes.byref(tape), rows, len(given), self._carried, self._sizes.ctypes.data, _addresses(given),
            strides.ctypes.data, len(made), self._widths.ctypes.data, _addresses(made),
        )  # fmt: skip
        found = dict(zip(self._results, made, strict=True))
        for name, result, shape in zip(self._names[: self._carried], self._results, self._shapes, strict=False):
            if values[name].ndim == 2:  # CasADi's matrices go by columns
                found[result] = found[result].reshape(rows, shape[1], shape[0]).transpose(0, 2, 1)
        return found

    def side_by_side(self, members: Sequence[Mapping[str, FloatArray]], wanted: str) -> FloatArray:
        """One result of several members, each as if it had been evaluated alone, to the last bit.

        Parameters
        ----------
        members
            All arguments of each member by name, of the same shapes in all of them.
        wanted
            Name of the result.

        Returns
        -------
        ndarray
            (members, K, n).

        Raises
        ------
        CompileError
            The library for several members can not be compiled or loaded.
        """
        run, j = _library_in_lanes(), self._results.index(wanted)
        prepared = [self._given(values) for values in members]
        rows, strides = prepared[0][1:]
        if any(each != rows or (other != strides).any() for _, each, other in prepared):
            raise ValueError("members have arguments of other shapes")
        found = np.empty((len(members), rows, self._widths[j]))
        memory = np.empty((len(self._tape.memory), LANES))
        for first in range(0, len(members), LANES):
            # a block that is not full has its last member several times
            block = [min(first + lane, len(members) - 1) for lane in range(LANES)]
            memory[:] = self._tape.memory[:, None]
            tape = TapeStruct(self._tape, memory, *self._machine_code(rows, LANES))
            values = [prepared[i][0][k] for k in range(len(self._names)) for i in block]
            run(
                ctypes.byref(tape), rows, len(self._names), self._carried, self._sizes.ctypes.data, _addresses(values),
                strides.ctypes.data, j, int(self._widths[j]), _addresses([found[i] for i in block]),
            )  # fmt: skip
        return found

    def _machine_code(self, rows: int, lanes: int) -> tuple[int | None, int | None]:
        """Where the compiled tape is, for one member or several; none before it was read for so many rows.

        What was compiled before, and is kept, is loaded at once.
        """
        before = self._rows.get(lanes, 0)
        self._rows[lanes] = before + rows
        worth = before + rows >= WORTH_COMPILING
        if lanes not in self._compiled and (worth or not before):
            name, source, flags = _kernel(self._tape, lanes)
            if worth or is_kept(name, source, flags):
                try:
                    self._compiled[lanes] = load_library(name, source, flags, _open_kernel)
                except CompileError:
                    self._compiled[lanes] = None, None
        return self._compiled.get(lanes, (None, None))

    def _given(self, values: Mapping[str, FloatArray]) -> tuple[list[FloatArray], int, NDArray[np.int64]]:
        """The arguments as the tape has them, the number of rows, and how far apart the rows of each argument are."""
        given = [self._columns(name, values[name]) for name in self._names]
        rows = max((len(a) for a in given if a.ndim == 2), default=1)
        for name, size, a in zip(self._names, self._sizes, given, strict=True):
            if a.shape[-1] != size or (a.ndim == 2 and (len(a) != rows or name in self._held)):
                raise ValueError(f"{name}: shape {values[name].shape} does not fit {rows} rows of {size}")
        return given, rows, np.array([a.shape[1] if a.ndim == 2 else 0 for a in given], dtype=np.int64)

    def _columns(self, name: str, value: FloatArray) -> FloatArray:
        """An argument as the tape has it: a carried matrix column by column."""
        flat = value.ravel(order="F") if name in self._names[: self._carried] else value
        return np.ascontiguousarray(flat, dtype=float)


def _addresses(arrays: Sequence[FloatArray]) -> Any:
    return (ctypes.c_void_p * len(arrays))(*(a.ctypes.data for a in arrays))


@lru_cache(maxsize=1)
def _library() -> Any:
    return load_library("recursion", RECURSION_SOURCE, LIBRARY_FLAGS, lambda path: _open(path, "recur"))


@lru_cache(maxsize=1)
def _library_in_lanes() -> Any:
    flags = (*LIBRARY_FLAGS, *_VECTORS[supported()[0].name])
    return load_library("recursion_in_lanes", recursion_in_lanes(LANES), flags, lambda at: _open(at, "recur_in_lanes"))


def _kernel(tape: Tape, lanes: int) -> tuple[str, str, Sequence[str]]:
    """Name, source and options of a compiled tape."""
    if lanes == 1:
        return "step", kernel_source({"step": tape}), KERNEL_FLAGS
    return "step_in_lanes", kernel_source_in_lanes("step", tape, lanes), (*_QUICK, *_VECTORS[supported()[0].name])


def _open_kernel(library: Path) -> tuple[int | None, int | None]:
    kernels = ctypes.CDLL(str(library))  # kept open: nothing closes a library that ctypes has opened
    held, each = (ctypes.cast(getattr(kernels, name), ctypes.c_void_p).value for name in ("step_held", "step"))
    return held, each


def _open(library: Path, name: str) -> Any:
    recur = getattr(ctypes.CDLL(str(library)), name)
    pointer, whole = ctypes.c_void_p, ctypes.c_int64
    further = (whole, whole, pointer) if name == "recur_in_lanes" else (whole, pointer, pointer)
    recur.argtypes = [pointer, whole, whole, whole, pointer, pointer, pointer, *further]
    recur.restype = None
    return recur
