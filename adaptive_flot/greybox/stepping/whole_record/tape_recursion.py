"""A function that hands part of its results on to its next call, over all rows in one call of machine code."""

from __future__ import annotations

import ctypes
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.compiled import CompileError, Written, is_kept, load_library
from adaptive_flot.greybox.stepping.whole_record.instruction_sets import AVX2, AVX512, SCALAR, supported
from adaptive_flot.greybox.stepping.whole_record.library import KERNEL_FLAGS, LIBRARY_FLAGS, TapeStruct
from adaptive_flot.greybox.stepping.whole_record.source import (
    kernel_source,
    kernel_source_in_lanes,
    recursion_source,
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


END, ALONG = "end", "along"
"""Arguments of a function that steps before each row fill: the state at the end, and its derivatives (n, q)."""


@dataclass(frozen=True)
class Steps:
    """Steps before each row, each the same function: its tape is short however many there are.

    Attributes
    ----------
    function
        SX function ``(x (n,), S (n, q), t, u, p) -> (x_next, S_next)``.
    times, length
        How many a row, and how long each is [s].
    start
        Derivatives at the start of each row (n, q).
    """

    function: ca.Function
    times: int
    length: float
    start: FloatArray


class _StepsStruct(ctypes.Structure):
    """The steps as the library sees them."""

    _fields_ = [
        ("tape", TapeStruct),
        *(
            (name, ctypes.c_int64)
            for name in (
                *("times", "state", "derivatives", "inputs", "parameters"),
                *("to_state", "to_derivatives", "of_time", "of_inputs", "of_parameters"),
            )
        ),
        ("length", ctypes.c_double),
        ("start", ctypes.c_void_p),
    ]


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
    steps
        Steps before each row, from the state that is the function's first argument, with its arguments t, u and p. The
        function has the arguments END and ALONG, which nobody else gives.

    Raises
    ------
    CompileError
        The library can not be compiled or loaded, or the function has an operation that it does not know.
    """

    def __init__(self, function: ca.Function, carried: int, held: Collection[str], steps: Steps | None = None) -> None:
        self._names = [function.name_in(i) for i in range(function.n_in())]
        self._results = [function.name_out(i) for i in range(function.n_out())]
        self._shapes = [function.size_in(i) for i in range(function.n_in())]
        self._sizes = np.array([function.numel_in(i) for i in range(function.n_in())], dtype=np.int64)
        self._widths = np.array([function.numel_out(i) for i in range(function.n_out())], dtype=np.int64)
        self._carried, self._held = carried, frozenset(held)
        self._tape = _Kept(tape_of(function, [i for i, name in enumerate(self._names) if name in held]))
        self._steps = steps
        self._step_tape = _Kept(tape_of(steps.function, [3, 4])) if steps is not None else None
        self._start = np.ravel(steps.start, order="F") if steps is not None else np.empty(0)
        _library(1)

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
        self._run(1, rows, given, strides, np.arange(len(made)), made)
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
        j = self._results.index(wanted)
        prepared = [self._given(values) for values in members]
        rows, strides = prepared[0][1:]
        if any(each != rows or (other != strides).any() for _, each, other in prepared):
            raise ValueError("members have arguments of other shapes")
        found = np.empty((len(members), rows, self._widths[j]))
        for first in range(0, len(members), LANES):
            # a block that is not full has its last member several times
            block = [min(first + lane, len(members) - 1) for lane in range(LANES)]
            values = [prepared[i][0][k] for k in range(len(self._names)) for i in block]
            self._run(LANES, rows, values, strides, np.array([j]), [found[i] for i in block])
        return found

    def _run(
        self,
        lanes: int,
        rows: int,
        values: Sequence[FloatArray],
        strides: NDArray[np.int64],
        wanted: NDArray[np.intp],
        found: Sequence[FloatArray],
    ) -> None:
        """Run all rows for so many members, and write the results that are wanted, a member beside the other."""
        run, memories = _library(lanes), list[FloatArray]()  # of their own, so that threads may run at once
        tape = self._tape.struct(rows, lanes, memories)
        steps = self._steps_struct(rows, lanes, memories)
        which, widths = wanted.astype(np.int64), self._widths[wanted]
        run(
            ctypes.byref(tape), steps and ctypes.byref(steps), rows, len(self._names), self._carried,
            self._sizes.ctypes.data, _addresses(values), strides.ctypes.data, len(which), which.ctypes.data,
            widths.ctypes.data, _addresses(found),
        )  # fmt: skip

    def _steps_struct(self, rows: int, lanes: int, memories: list[FloatArray]) -> _StepsStruct | None:
        if self._steps is None or self._step_tape is None:
            return None
        function, names = self._steps.function, self._names
        n, q, _, inputs, parameters = (function.numel_in(i) for i in range(5))
        return _StepsStruct(
            self._step_tape.struct(rows * self._steps.times, lanes, memories),
            *(self._steps.times, n, q, inputs, parameters),
            *(names.index(name) for name in (END, ALONG, "t", "u", "p")),
            self._steps.length,
            self._start.ctypes.data,
        )

    def _given(self, values: Mapping[str, FloatArray]) -> tuple[list[FloatArray], int, NDArray[np.int64]]:
        """The arguments as the tape has them, the number of rows, and how far apart the rows of each argument are."""
        if self._steps is not None:
            made = {END, ALONG} & set(self._names)
            sizes = dict(zip(self._names, self._sizes, strict=True))
            values = {**values, **{name: np.zeros(sizes[name]) for name in made}}
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


class _Kept:
    """A tape, and what has been compiled of it."""

    def __init__(self, tape: Tape) -> None:
        self.tape = tape
        self._rows: dict[int, int] = {}
        self._compiled: dict[int, tuple[int | None, int | None]] = {}

    def struct(self, rows: int, lanes: int, memories: list[FloatArray]) -> TapeStruct:
        """The tape as the library sees it, for so many rows and members; its memory is put into a list to stay."""
        memory = np.repeat(self.tape.memory[:, None], lanes, axis=1)
        memories.append(memory)
        return TapeStruct(self.tape, memory, *self._machine_code(rows, lanes))

    def _machine_code(self, rows: int, lanes: int) -> tuple[int | None, int | None]:
        """Where the compiled tape is, for one member or several; none before it was read for so many rows.

        What was compiled before, and is kept, is loaded at once.
        """
        before = self._rows.get(lanes, 0)
        self._rows[lanes] = before + rows
        worth = before + rows >= WORTH_COMPILING
        if lanes not in self._compiled and (worth or not before):
            name, source, flags = _kernel(self.tape, lanes)
            if worth or is_kept(name, source, flags):
                try:
                    self._compiled[lanes] = load_library(name, source, flags, _open_kernel)
                except CompileError:
                    self._compiled[lanes] = None, None
        return self._compiled.get(lanes, (None, None))


def _addresses(arrays: Sequence[FloatArray]) -> Any:
    at = {id(a): a for a in arrays}  # members have most of their arguments in common
    known = {key: a.ctypes.data for key, a in at.items()}
    return (ctypes.c_void_p * len(arrays))(*(known[id(a)] for a in arrays))


@lru_cache(maxsize=2)
def _library(lanes: int) -> Any:
    name = "recursion" if lanes == 1 else "recursion_in_lanes"
    flags = LIBRARY_FLAGS if lanes == 1 else (*LIBRARY_FLAGS, *_VECTORS[supported()[0].name])
    return load_library(name, recursion_source(lanes), flags, _open)


def _kernel(tape: Tape, lanes: int) -> tuple[str, Written, Sequence[str]]:
    """Name, source and options of a compiled tape."""
    if lanes == 1:
        return "step", kernel_source({"step": tape}), KERNEL_FLAGS
    return "step_in_lanes", kernel_source_in_lanes("step", tape, lanes), (*_QUICK, *_VECTORS[supported()[0].name])


def _open_kernel(library: Path) -> tuple[int | None, int | None]:
    kernels = ctypes.CDLL(str(library))  # kept open: nothing closes a library that ctypes has opened
    held, each = (ctypes.cast(getattr(kernels, name), ctypes.c_void_p).value for name in ("step_held", "step"))
    return held, each


def _open(library: Path) -> Any:
    recur = ctypes.CDLL(str(library)).recur
    pointer, whole = ctypes.c_void_p, ctypes.c_int64
    recur.argtypes = [pointer, pointer, *[whole] * 3, *[pointer] * 3, whole, *[pointer] * 3]
    recur.restype = None
    return recur
