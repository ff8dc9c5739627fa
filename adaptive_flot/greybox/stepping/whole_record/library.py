"""Whole records in one call of machine code."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.compiled import FLAGS, CompileError, load_library
from adaptive_flot.greybox.stepping.step_functions import Interval
from adaptive_flot.greybox.stepping.whole_record.kernels import kernels
from adaptive_flot.greybox.stepping.whole_record.source import record_source

_FLAGS = (*FLAGS, "-ftree-vectorize")
MOST_OPERATIONS = 20_000
"""Operations of a step above which the compiler takes longer than it saves."""
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
        It can not be compiled or loaded.
    """

    def __init__(self, model: Model, dt: float | None, substeps: int, wrt: Sequence[str] | None) -> None:
        self._dt, self._substeps, self._wrt = dt, substeps, None if wrt is None else tuple(wrt)
        counts = (len(q) for q in (model.states, model.inputs, model.outputs, model.signals))
        self._nx, nu, self._ny, self._ns = counts
        self._width, self._np = nu + (dt is None), len(model.parameters)
        made = kernels(model, self._wrt, dt is not None)
        operations = made.rates.n_instructions() + made.ends.n_instructions()
        if operations > MOST_OPERATIONS:
            raise CompileError(f"{model.name} has {operations} operations; the compiler would take too long")
        sizes = self._nx, nu, self._ny, self._ns
        source, numbers = record_source(made, sizes, len(self._wrt or ()))
        self._numbers = np.array(numbers or [0.0])
        self._run = load_library("record", source, _FLAGS, _open)

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
        self._run(
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
            _pointer(self._numbers),
            int(anew),
            *map(_pointer, wanted),
            _pointer(made.last_state),
            _pointer(made.last_gradient),
            _pointer(work),
        )
        return made


def whole_record(model: Model, interval: Interval, wrt: tuple[str, ...] | None) -> WholeRecord | None:
    """Machine code of a model for records, None where it can not be had. For `Model.derived`."""
    try:
        return WholeRecord(model, interval.dt, interval.substeps, wrt)
    except CompileError:
        return None


def _pointer(array: FloatArray | None) -> ctypes.c_void_p:
    return ctypes.c_void_p(None if array is None else array.ctypes.data)


def _open(library: Path) -> Any:
    run = ctypes.CDLL(str(library)).run
    pointer, whole, real = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
    run.argtypes = [whole, whole, real, real, *[pointer] * 2, whole, *[pointer] * 2, whole, pointer, whole]
    run.argtypes += [pointer] * 8
    run.restype = None
    return run
