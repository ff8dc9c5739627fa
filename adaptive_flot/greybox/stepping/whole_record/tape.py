"""A list of scalar operations as numbers, which one library runs for every model.

To compile the equations of each model takes a compiler longer than a few runs of a record. A tape is read instead: an
operation is four numbers, its kind and three places in a memory that holds arguments, results, the numbers of the
equations, and what is worked out on the way. The same operations as C are for a model that runs many times.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiled import CompileError
from adaptive_flot.greybox.stepping.whole_record.statements import BINARY, CODES, UNARY

END = "END"
TEMPLATES = {**UNARY, **BINARY}
OPERATIONS = (*TEMPLATES, END)
"""Kinds of operations; the place of each is its number on a tape."""
STRUCTURAL = frozenset({0.0, 1.0, -1.0, 2.0, 0.5})
"""Numbers that are part of the form of an equation."""
MOST_PLACES = 2**16
"""Places that a number of two bytes can tell apart."""


@dataclass(frozen=True)
class Tape:
    """The operations of a function.

    Attributes
    ----------
    code
        Kind, place of the result and places of the operands of each operation (n, 4); the last is `END`.
    memory
        The memory (places,) as it is at first: zero but for the numbers of the equations.
    arguments, results
        Where each argument and each result of the function begins (int).
    numbers
        Places of the first number of the equations, and of the first intermediate value.
    """

    code: NDArray[np.uint16]
    memory: FloatArray
    arguments: NDArray[np.int64]
    results: NDArray[np.int64]
    numbers: tuple[int, int]

    def c_function(self, name: str) -> str:
        """The same as a C function `void NAME(const double *i, double *o)`: both are the memory.

        Numbers stand in the memory, so that two models of the same structure have the same code; but those that are
        part of the form of an equation.
        """
        first, beyond = self.numbers

        def read(place: int) -> str:
            if place >= beyond:
                return f"a{place}"
            value = float(self.memory[place])
            return repr(value) if place >= first and value in STRUCTURAL else f"i[{place}]"

        body = []
        for kind, to, one, other in self.code[:-1].tolist():
            made = f"a{to}" if to >= beyond else f"o[{to}]"
            body.append(f"{made}={TEMPLATES[OPERATIONS[kind]].format(read(one), read(other))};")
        places = ", ".join(f"a{place}" for place in range(beyond, len(self.memory)))
        declared = f"double {places};" if places else ""
        return "\n".join([f"void {name}(const double *restrict i, double *restrict o) {{", declared, *body, "}"])


def tape_of(function: ca.Function) -> Tape:
    """The tape of an SX function.

    Raises
    ------
    CompileError
        It is no SX function, is not dense, has an operation that has no form in C, or is too large.
    """
    name = function.name()
    if not function.is_a("SXFunction"):
        raise CompileError(f"{name} is no list of scalar operations")
    given = [function.numel_in(i) for i in range(function.n_in())]
    made = [function.numel_out(i) for i in range(function.n_out())]
    if given != [function.nnz_in(i) for i in range(function.n_in())] or made != [
        function.nnz_out(i) for i in range(function.n_out())
    ]:
        raise CompileError(f"{name} has an argument or result that is not dense")
    arguments = np.concatenate([[0], np.cumsum(given)]).astype(np.int64)
    results = (arguments[-1] + np.concatenate([[0], np.cumsum(made)])).astype(np.int64)
    steps, numbers = _steps(function, arguments, results)
    first = int(results[-1]) + len(numbers)  # of the places that the function itself works in
    code = np.array([(kind, *(_place(at, first) for at in places)) for kind, *places in steps], dtype=np.int64)
    places = max(int(code[:, 1:].max(initial=0)), first) + 1
    if places > MOST_PLACES:
        raise CompileError(f"{name} is too large: {places} places")
    memory = np.zeros(places)
    memory[results[-1] : first] = numbers
    where = int(results[-1]), first
    return Tape(np.ascontiguousarray(code, dtype=np.uint16), memory, arguments[:-1], results[:-1], where)


Step = tuple[int, int, int, int]


def _steps(
    function: ca.Function, arguments: NDArray[np.int64], results: NDArray[np.int64]
) -> tuple[list[Step], list[float]]:
    """Each operation with its places, and the numbers of the equations. Intermediate values count from -1 down.

    What only fetches an argument or a number is no operation: whoever uses it reads it where it is.
    """
    number = {kind: k for k, kind in enumerate(OPERATIONS)}
    numbers: list[float] = []
    at: dict[int, int] = {}
    steps: list[Step] = []
    for k in range(function.n_instructions()):
        operation = CODES.get(function.instruction_id(k), "?")
        i, o = function.instruction_input(k), function.instruction_output(k)
        if operation == "INPUT":
            at[o[0]] = int(arguments[i[0]]) + i[1]
        elif operation == "CONST":
            at[o[0]] = int(results[-1]) + len(numbers)
            numbers.append(function.instruction_constant(k))
        elif operation == "OUTPUT":
            steps.append((number["ASSIGN"], int(results[o[0]]) + o[1], at[i[0]], 0))
        elif operation in number:
            operands = [at[j] for j in i]
            at[o[0]] = -1 - o[0]
            steps.append((number[operation], at[o[0]], operands[0], operands[-1]))
        else:
            raise CompileError(f"{function.name()} has the operation {operation}, which has no form in C")
    return [*steps, (number[END], 0, 0, 0)], numbers


def _place(at: int, first: int) -> int:
    return at if at >= 0 else first - 1 - at
