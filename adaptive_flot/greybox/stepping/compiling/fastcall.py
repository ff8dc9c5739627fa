"""Call a CasADi function from a Python loop without its conversion overhead."""

from __future__ import annotations

import io
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from typing import Any

import casadi as ca
import numpy as np

from adaptive_flot.child_processes import heed_signals
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.compiled import compiled

ONE_NUMBER = ((), (1,), (1, 1))
"""Shapes that fit an argument of one number."""


class FastCall:
    """A CasADi function with dense arguments, called through its buffers (a few microseconds instead of about 40).

    Arguments and results are NumPy arrays; results are fresh copies, so nothing that the caller keeps can change.
    A `FastCall` holds working memory: use one in each thread.

    Parameters
    ----------
    function
        The function.
    matrices
        Names of arguments and results that are matrices (n, m) also where m is 1; a column is else a vector (n,).
    as_machine_code
        Compile it (see `compiled`); the constructor then takes as long as the compiler, the first time.
    """

    def __init__(self, function: ca.Function, matrices: Sequence[str] = (), *, as_machine_code: bool = False) -> None:
        self.function = compiled(_dense(function)) if as_machine_code else _dense(function)
        self._buffer, self._evaluate = self.function.buffer()
        self._plain = bool(self.function.is_a("SXFunction") or self.function.is_a("External"))
        arguments = [np.zeros(self.function.nnz_in(i)) for i in range(self.function.n_in())]
        results = [np.zeros(self.function.nnz_out(i)) for i in range(self.function.n_out())]
        # SWIG turns a memoryview into pointer and size; the stubs know only the C signature
        for i, argument in enumerate(arguments):
            self._buffer.set_arg(i, argument.data)  # type: ignore[call-arg]
        for i, result in enumerate(results):
            self._buffer.set_res(i, result.data)  # type: ignore[call-arg]
        # CasADi stores matrices by columns: these views have the shape that the caller sees
        f, keep = self.function, set(matrices)
        self._arguments = [
            a.reshape(_shape(f.size_in(i), f.name_in(i) in keep), order="F") for i, a in enumerate(arguments)
        ]
        self._results = [
            r.reshape(_shape(f.size_out(i), f.name_out(i) in keep), order="F") for i, r in enumerate(results)
        ]

    def __call__(self, *arguments: FloatArray | float) -> tuple[FloatArray, ...]:
        """Evaluate. Column vectors come and go as (n,), matrices as (n, m); a number fits a (1,) argument.

        A function that fails (an integrator that gives up) returns NaN.

        Raises
        ------
        ModelError
            Wrong number of arguments, or one has the wrong shape.
        """
        if len(arguments) != len(self._arguments):
            raise ModelError(f"{self.function.name()}: {len(arguments)} arguments given, {len(self._arguments)} taken")
        for target, value in zip(self._arguments, arguments, strict=True):
            # NumPy would stretch a value of size 1 over a longer argument without a word
            shape = value.shape if isinstance(value, np.ndarray) else np.shape(value)
            if shape != target.shape and (target.shape != (1,) or shape not in ONE_NUMBER):
                name = self.function.name_in([a is target for a in self._arguments].index(True))
                raise ModelError(f"argument {name!r} has the shape {shape}, the model takes {target.shape}")
            target[...] = value
        if self._plain:
            self._evaluate()
        else:
            self._evaluate_quietly()
        heed_signals()  # CasADi calls their handlers, and may lose what these raise
        return tuple([result.copy() for result in self._results])

    def stats(self) -> dict[str, Any]:
        """What a solver or integrator tells of its last evaluation."""
        return dict(self._buffer.stats())

    def _evaluate_quietly(self) -> None:
        """An integrator may give up: then the results are NaN, and what it prints of its troubles is not shown."""
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            try:
                self._evaluate()
            except RuntimeError:
                for result in self._results:
                    result[...] = np.nan


def _shape(size: tuple[int, int], matrix: bool) -> tuple[int, ...]:
    return (size[0],) if size[1] == 1 and not matrix else size


def _dense(function: ca.Function) -> ca.Function:
    if all(function.sparsity_out(i).is_dense() for i in range(function.n_out())):
        return function
    arguments = function.mx_in()
    results = (
        [ca.densify(r) for r in function(*arguments)] if function.n_out() > 1 else [ca.densify(function(*arguments))]
    )
    names = (
        [function.name_in(i) for i in range(function.n_in())],
        [function.name_out(i) for i in range(function.n_out())],
    )
    return ca.Function(function.name(), arguments, results, *names)
