"""Call a CasADi function from a Python loop without its conversion overhead."""

from __future__ import annotations

import casadi as ca
import numpy as np

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray


class FastCall:
    """A CasADi function with dense arguments, called through its buffers (a few microseconds instead of about 40).

    Arguments and results are NumPy arrays; results are fresh copies, so nothing that the caller keeps can change.
    A `FastCall` holds working memory: use one in each thread.
    """

    def __init__(self, function: ca.Function) -> None:
        self.function = _dense(function)
        self._buffer, self._evaluate = self.function.buffer()
        self._arguments = [np.zeros(self.function.nnz_in(i)) for i in range(self.function.n_in())]
        self._results = [np.zeros(self.function.nnz_out(i)) for i in range(self.function.n_out())]
        self._shapes = [_array_shape(self.function.size_out(i)) for i in range(self.function.n_out())]
        # SWIG turns a memoryview into pointer and size; the stubs know only the C signature
        for i, argument in enumerate(self._arguments):
            self._buffer.set_arg(i, argument.data)  # type: ignore[call-arg]
        for i, result in enumerate(self._results):
            self._buffer.set_res(i, result.data)  # type: ignore[call-arg]

    def __call__(self, *arguments: FloatArray | float) -> tuple[FloatArray, ...]:
        """Evaluate. Column vectors come back as (n,), matrices as (n, m).

        Raises
        ------
        ModelError
            An argument has the wrong number of elements.
        """
        if len(arguments) != len(self._arguments):
            raise ModelError(f"{self.function.name()}: {len(arguments)} arguments given, {len(self._arguments)} taken")
        for i, (target, value) in enumerate(zip(self._arguments, arguments, strict=True)):
            flat = np.asarray(value, dtype=float).ravel(order="F")
            if flat.size != target.size:
                name = self.function.name_in(i)
                raise ModelError(f"argument {name!r} has {flat.size} elements, the model takes {target.size}")
            target[:] = flat
        self._evaluate()
        return tuple(
            result.reshape(shape, order="F").copy() for result, shape in zip(self._results, self._shapes, strict=True)
        )


def _array_shape(size: tuple[int, int]) -> tuple[int, ...]:
    return (size[0],) if size[1] == 1 else size


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
