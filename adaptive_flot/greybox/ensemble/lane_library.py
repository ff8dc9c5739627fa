"""A function in lanes as machine code, called on blocks of members by several threads."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from adaptive_flot.greybox.ensemble.lane_source import lane_source
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.compiled import CompileError, load_library
from adaptive_flot.greybox.stepping.rows import worker_threads
from adaptive_flot.greybox.stepping.whole_record.instruction_sets import InstructionSet, supported

PIECES = 4
"""Calls for each thread: one that is held up leaves little to wait for."""


class LaneLibrary:
    """Machine code of a function in lanes.

    Parameters
    ----------
    function, carried
        As of `lane_source`.
    instructions
        Instruction set; default the widest of this machine that works.

    Raises
    ------
    CompileError
        It can not be compiled or loaded.
    """

    def __init__(
        self, function: ca.Function, carried: Sequence[int], instructions: InstructionSet | None = None
    ) -> None:
        self.instructions, self._run = _load(function, carried, instructions)

    def __call__(
        self, arguments: Sequence[FloatArray], results: Sequence[FloatArray | None], members: int, rows: int
    ) -> None:
        """Evaluate rows for members.

        Parameters
        ----------
        arguments
            An array (rows, entries, members) each, of any strides; what all rows or members share has stride zero.
        results
            Arrays (rows, entries, members) to be filled, or (1, entries, members) for the last row alone; None where
            nobody wants it.
        members, rows
            Numbers of both.
        """
        lanes = self.instructions.lanes
        given: list[Any] = [_pointers(arguments), _strides(arguments), _pointers(results), _strides(results)]
        call: Callable[[int, int], None] = partial(self._run, *given, members, rows)
        blocks = -(-members // lanes)
        threads = min(worker_threads(), blocks)
        if threads == 1:
            call(0, blocks)
            return
        ends = np.linspace(0, blocks, min(PIECES * threads, blocks) + 1).astype(int).tolist()
        # what is called lets go of the interpreter, so that threads are enough
        for done in [_pool(threads).submit(call, *piece) for piece in pairwise(ends)]:
            done.result()


def _load(function: ca.Function, carried: Sequence[int], wanted: InstructionSet | None) -> tuple[InstructionSet, Any]:
    """Instruction set and `run` of the widest that works."""
    failure = CompileError("no instruction set")
    for instructions in supported() if wanted is None else (wanted,):
        source = lane_source(function, carried, instructions.lanes)
        try:
            name = function.name() + "_lanes"
            return instructions, load_library(
                name, source, instructions.flags, lambda p: opened(ctypes.CDLL(str(p)), 4)
            )
        except CompileError as error:  # a compiler that knows no OpenMP, a system without a vector library
            failure = error
    raise failure


def opened(library: ctypes.CDLL, pointers: int) -> Any:
    """Its function `run`, which takes so many pointers, and then the numbers of `LaneLibrary.__call__`."""
    run = library.run
    run.argtypes, run.restype = [ctypes.c_void_p] * pointers + [ctypes.c_int64] * 4, None
    return run


def _pointers(arrays: Sequence[FloatArray | None]) -> ctypes.Array[ctypes.c_void_p]:
    return (ctypes.c_void_p * max(1, len(arrays)))(*(None if a is None else a.ctypes.data for a in arrays))


def _strides(arrays: Sequence[FloatArray | None]) -> Any:
    table: NDArray[np.int64] = np.zeros((max(1, len(arrays)), 3), dtype=np.int64)
    for row, array in zip(table, arrays, strict=False):
        if array is not None:
            # of an axis of one entry NumPy may tell any stride
            row[:] = [s // array.itemsize if n > 1 else 0 for s, n in zip(array.strides, array.shape, strict=True)]
    return table.ctypes.data_as(ctypes.c_void_p)


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="lanes")
