"""Whole records in one call of machine code, which is the same for every model."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.compiling.compiled import FLAGS, CompileError, is_kept, load_library
from adaptive_flot.greybox.stepping.step_functions import Interval
from adaptive_flot.greybox.stepping.whole_record.kernels import kernels, weight_kernels
from adaptive_flot.greybox.stepping.whole_record.source import RECORD_SOURCE, kernel_source
from adaptive_flot.greybox.stepping.whole_record.tape import Tape, tape_of

LIBRARY_FLAGS = ("-O2", "-ftree-vectorize", "-fno-gcse", "-fno-crossjumping", "-ffp-contract=off", "-fPIC", "-shared")
"""Without `gcse` and `crossjumping` each operation keeps a jump of its own, which the processor then foresees."""
KERNEL_FLAGS = (*FLAGS, "-fno-builtin-pow")
"""A compiler that knows a power writes it as a product, whose last bit may be another."""
WORTH_COMPILING = 12_000
"""Steps of a model from which its own equations are compiled. A step by tape takes some 1 ns an operation longer, and
the compiler 50 us an operation; an operation stands in four evaluations of a step."""
MOST_OPERATIONS = 20_000
"""Operations of a step above which its tape takes longer to write than it saves."""
_MATRICES = 11
"""Matrices (nx, q) of working memory."""


@dataclass(frozen=True)
class Rows:
    """What a run gave: states (N, nx), outputs (N, ny), signals (N, ns); derivatives along q directions.

    `gradients` (N, ny, q) are those of the outputs, `state_gradients` (N, nx, q) those of the states, `last_gradient`
    (nx, q) those of the last state (nx,). Empty where they were not asked for.
    """

    states: FloatArray
    outputs: FloatArray
    signals: FloatArray
    gradients: FloatArray
    state_gradients: FloatArray
    last_state: FloatArray
    last_gradient: FloatArray


class TapeStruct(ctypes.Structure):
    """A tape as the library sees it."""

    _fields_ = [
        (name, ctypes.c_void_p)
        for name in ("held", "code", "memory", "arguments", "results", "compiled_held", "compiled")
    ]

    def __init__(self, tape: Tape, memory: FloatArray, held: int | None, compiled: int | None) -> None:
        held_at, code_at, arguments_at, results_at = tape.addresses
        super().__init__(held_at, code_at, memory.ctypes.data, arguments_at, results_at, held, compiled)


_SIZES = ("nx", "nu", "ny", "ns", "np", "nr", "rx", "ne")
_TABLES = ("decays", "rate_rows", "rate_columns", "end_rows", "end_columns")
_HELD = {"rates": (2, 3), "ends": (2, 3), "near": (), "far": ()}
"""Each tape, with the places of its arguments that are held from step to step: inputs and parameters."""


class _Kernels(ctypes.Structure):
    """Kernels as the library sees them."""

    _fields_ = [
        *((name, ctypes.c_int64) for name in _SIZES),
        *((name, ctypes.c_void_p) for name in _TABLES),
        *((name, TapeStruct) for name in _HELD),
    ]


class WholeRecord:
    """The fast step of a model over records, in machine code.

    Parameters
    ----------
    model
        The model.
    dt
        Length of an interval [s]; None where it is the last entry of each row of the inputs.
    substeps
        Steps an interval.
    wrt
        Parameters whose derivatives can be asked for; None where none can be, not even by the initial state.

    Raises
    ------
    CompileError
        The library can not be compiled or loaded, or the model has an operation that it does not know.
    """

    def __init__(self, model: Model, dt: float | None, substeps: int, wrt: Sequence[str] | None) -> None:
        self._dt, self._substeps = dt, substeps
        counts = (len(q) for q in (model.states, model.inputs, model.outputs, model.signals))
        self._nx, nu, self._ny, self._ns = counts
        self._width, self._np = nu + (dt is None), len(model.parameters)
        made = kernels(model, None if wrt is None else tuple(wrt), dt is not None)
        operations = made.rates.n_instructions() + made.ends.n_instructions()
        if operations > MOST_OPERATIONS:
            raise CompileError(f"{model.name} has {operations} operations; their tape would take too long to write")
        rate, end = made.rates_entries, made.ends_entries
        jacobians = len(rate), sum(row < self._nx for row, _ in rate), len(end)
        self._sizes = self._nx, nu, self._ny, self._ns, self._np, *jacobians
        self._tables = _table([*made.decays, 0], np.uint8), *_columns(rate), *_columns(end)
        own = {name: tape_of(getattr(made, name), _HELD[name]) for name in ("rates", "ends")}
        self._tapes = own | _weight_tapes(dt is not None, wrt is not None)
        self._run = _library()
        self._compiled: dict[str, int] | None = None
        self._steps = 0

    def __call__(
        self,
        x0: FloatArray,
        inputs: FloatArray,
        parameters: FloatArray,
        t0: float = 0.0,
        directions: FloatArray | None = None,
        *,
        anew: bool = False,
    ) -> Rows:
        """Simulate N intervals.

        Parameters
        ----------
        x0, t0
            State (nx,) at the start, and its time [s].
        inputs, parameters
            Inputs of each row (N, nu), with its length where that varies; parameters (np,) or (N, np).
        directions
            Derivatives (nx, q) of the state at the start; the first directions are those of the parameters `wrt`.
        anew
            Whether the derivatives start again from `directions` in every row; then those of the states are given too.
        """
        rows, q = len(inputs), 0 if directions is None else directions.shape[1]
        x, u, p = (np.ascontiguousarray(a, dtype=float) for a in (x0, inputs, parameters))
        S = np.ascontiguousarray(np.zeros((self._nx, 0)) if directions is None else directions, dtype=float)
        if u.shape != (rows, self._width) or p.shape[-1:] != (self._np,) or len(x) != self._nx:
            raise ValueError(f"shapes {x.shape}, {u.shape}, {p.shape} do not fit the model")
        plain = directions is None
        made = Rows(
            np.empty((rows, self._nx)),
            np.empty((rows, self._ny)),
            np.empty((rows, self._ns)),
            np.empty((0 if plain else rows, self._ny, q)),
            np.empty((rows if anew else 0, self._nx, q)),
            np.empty(self._nx),
            np.empty((self._nx, q)),
        )
        work = np.empty(_MATRICES * self._nx * q)
        wanted: list[FloatArray | None] = [made.states, made.outputs, made.signals]
        wanted += [None if plain else made.gradients, made.state_gradients if anew else None]
        compiled = self._machine_code(rows)
        memories = {name: tape.memory.copy() for name, tape in self._tapes.items()}  # so that threads may run at once
        tapes = [
            TapeStruct(tape, memories[name], compiled.get(f"{name}_held"), compiled.get(name))
            for name, tape in self._tapes.items()
        ]
        given = _Kernels(*self._sizes, *(table.ctypes.data for table in self._tables), *tapes)
        self._run(
            ctypes.byref(given),
            rows,
            self._substeps,
            self._dt or 0.0,
            t0,
            _pointer(x),
            _pointer(S),
            q,
            _pointer(u),
            _pointer(p),
            self._np if p.ndim == 2 else 0,
            int(anew),
            *map(_pointer, wanted),
            _pointer(made.last_state),
            _pointer(made.last_gradient),
            _pointer(work),
        )
        return made

    def _machine_code(self, rows: int) -> Mapping[str, int]:
        """Where the compiled tapes are; none before the model has run so often that the compiler is worth it."""
        first = not self._steps
        self._steps += rows * self._substeps
        if self._compiled is None and (first or self._steps >= WORTH_COMPILING):
            source = kernel_source(self._tapes)
            if self._steps >= WORTH_COMPILING or is_kept("kernels", source, KERNEL_FLAGS):
                try:
                    self._compiled = load_library("kernels", source, KERNEL_FLAGS, _open_kernels)
                except CompileError:
                    self._compiled = {}
        return self._compiled or {}


@lru_cache(maxsize=4)
def _weight_tapes(fixed_step: bool, derivatives: bool) -> dict[str, Tape]:
    near, far = weight_kernels(fixed_step, derivatives)
    return {"near": tape_of(near, _HELD["near"]), "far": tape_of(far, _HELD["far"])}


def whole_record(model: Model, interval: Interval, wrt: tuple[str, ...] | None) -> WholeRecord | None:
    """Machine code of a model for records, None where it can not be had. For `Model.derived`."""
    try:
        return WholeRecord(model, interval.dt, interval.substeps, wrt)
    except CompileError:
        return None


def _table(values: Sequence[int], kind: type[np.integer[Any]]) -> NDArray[np.integer[Any]]:
    return np.ascontiguousarray(values, dtype=kind)


def _columns(entries: Sequence[tuple[int, int]]) -> tuple[NDArray[np.integer[Any]], NDArray[np.integer[Any]]]:
    """Rows and columns of the entries of a Jacobian."""
    rows, columns = ([e[k] for e in entries] for k in range(2))
    return _table(rows, np.int16), _table(columns, np.int16)


def _pointer(array: FloatArray | None) -> ctypes.c_void_p:
    return ctypes.c_void_p(None if array is None else array.ctypes.data)


@lru_cache(maxsize=1)
def _library() -> Any:
    return load_library("record", RECORD_SOURCE, LIBRARY_FLAGS, _open)


def _open(library: Path) -> Any:
    run = ctypes.CDLL(str(library)).run
    pointer, whole, real = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
    run.argtypes = [pointer, whole, whole, real, real, *[pointer] * 2, whole, *[pointer] * 2, whole, whole]
    run.argtypes += [pointer] * 8
    run.restype = None
    return run


def _open_kernels(library: Path) -> dict[str, int]:
    """Addresses of the functions of a library, which stays loaded."""
    opened = ctypes.CDLL(str(library))
    names = [each for name in _HELD for each in (name, f"{name}_held")]
    return {name: int(ctypes.cast(getattr(opened, name), ctypes.c_void_p).value or 0) for name in names}
