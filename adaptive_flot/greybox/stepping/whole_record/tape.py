"""A list of scalar operations as numbers, which one library runs for every model.

To compile the equations of each model takes a compiler longer than a few runs of a record. A tape is read instead: an
operation is four numbers, its kind and three places in a memory that holds arguments, results, the numbers of the
equations, and what is worked out on the way. The same operations as C are for a model that runs many times.

What depends on arguments that rarely change (inputs and parameters of a row) is worked out once for them, by a list of
its own: a quarter of the operations of a flotation cell, and of its powers.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.compiled import CompileError
from adaptive_flot.greybox.stepping.whole_record.statements import BINARY, CODES, UNARY

END = "END"
TEMPLATES = {**UNARY, **BINARY}
OPERATIONS = (*TEMPLATES, END)
"""Kinds of operations; the place of each is its number on a tape."""
ON_VECTORS = frozenset({"ASSIGN", "NEG", "SQ", "TWICE", "INV", "ADD", "SUB", "MUL", "DIV"})
"""Kinds that C has for vectors of numbers as well as for numbers."""
STRUCTURAL = (0.0, 1.0, -1.0, 2.0, 0.5)
"""Numbers that are part of the form of an equation."""
MOST_PLACES = 2**16
"""Places that a number of two bytes can tell apart."""


@dataclass(frozen=True)
class Tape:
    """The operations of a function.

    Attributes
    ----------
    held
        The operations that depend on held arguments alone: kind, place of the result and places of the operands of each
        (n, 4); the last is `END`.
    code
        The other operations in the same way.
    memory
        The memory (places,) as it is at first: zero but for the numbers of the equations.
    arguments, results
        Where each argument and each result of the function begins (int).
    numbers
        Places of the first number of the equations, and of the first value that is worked out.
    """

    held: NDArray[np.uint16]
    code: NDArray[np.uint16]
    memory: FloatArray
    arguments: NDArray[np.int64]
    results: NDArray[np.int64]
    numbers: tuple[int, int]

    @cached_property
    def addresses(self) -> tuple[int, int, int, int]:
        """Where `held`, `code`, `arguments` and `results` are; asked for in every run."""
        held, code, arguments, results = (
            int(a.ctypes.data) for a in (self.held, self.code, self.arguments, self.results)
        )
        return held, code, arguments, results

    @cached_property
    def digest(self) -> str:
        """What its C functions are written from, as one number."""
        parts = self.held.tobytes(), self.code.tobytes(), repr(self.numbers).encode(), self._form
        return hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()

    @property
    def _form(self) -> bytes:
        """Numbers of the equations, NaN where one is not part of their form."""
        first, beyond = self.numbers
        numbers = self.memory[first:beyond]
        return np.where(np.isin(numbers, STRUCTURAL), numbers, np.nan).tobytes()

    def c_functions(self, name: str, *, in_lanes: bool = False) -> str:
        """The same as C functions `void NAME(const double *i, double *o)` and `NAME_held`: both are the memory.

        Numbers stand in the memory, so that two models of the same structure have the same code; but those that are
        part of the form of an equation. In lanes a place of the memory is a vector `V` of numbers, and what C has not
        for vectors is a call `do_KIND` of two vectors.
        """
        form, first = self._form, self.numbers[0]
        parts = (f"{name}_held", self.held, True), (name, self.code, False)
        return "\n".join(_c_function(to, code.tobytes(), form, first, holds, in_lanes) for to, code, holds in parts)


def _c_function(name: str, code: bytes, form: bytes, first: int, holds: bool, in_lanes: bool) -> str:
    """One of them, from the bytes of its operations and of its numbers; NaN where a number is not part of the form."""
    of = "V" if in_lanes else "double"
    operations = np.frombuffer(code, dtype=np.uint16).reshape(-1, 4)[:-1].tolist()
    numbers = np.frombuffer(form).tolist()
    beyond = first + len(numbers)
    made = {to for _, to, _, _ in operations if to >= beyond}
    declared, body = dict[int, None](), list[str]()

    def read(place: int) -> str:
        if place in made:
            return f"a{place}"
        value = numbers[place - first] if first <= place < beyond and not in_lanes else np.nan
        return f"i[{place}]" if value != value else repr(value)

    for number, to, one, other in operations:
        kind = OPERATIONS[number]
        template = TEMPLATES[kind] if kind in ON_VECTORS or not in_lanes else f"do_{kind}({{0}},{{1}})"
        value = template.format(read(one), read(other))
        if to < beyond:
            body.append(f"o[{to}]={value};")
            continue
        declared[to] = None
        body.append(f"a{to}={value};")
        if holds:
            body.append(f"o[{to}]=a{to};")
    places = ", ".join(f"a{place}" for place in declared)
    lines = [f"{of} {places};" if places else "", *body, "}"]
    return "\n".join([f"void {name}(const {of} *restrict i, {of} *restrict o) {{", *lines])


def tape_of(function: ca.Function, held: Sequence[int] = ()) -> Tape:
    """The tape of an SX function, with the places of the arguments that are held from one call to the next.

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
    once, steps, numbers, left = _steps(function, arguments, results, held)
    first = int(results[-1]) + len(numbers)  # of the places that the function itself works in
    held_code, code = (_placed(np.array(part, dtype=np.int64), first, left) for part in (once, steps))
    places = max(int(code[:, 1:].max(initial=0)), first + left) + 1
    if places > MOST_PLACES:
        raise CompileError(f"{name} is too large: {places} places")
    memory = np.zeros(places)
    memory[results[-1] : first] = numbers
    where = int(results[-1]), first
    before, written = (np.ascontiguousarray(part, dtype=np.uint16) for part in (held_code, code))
    return Tape(before, written, memory, arguments[:-1], results[:-1], where)


Step = tuple[int, int, int, int]
HELD = 2**20
"""From this number on a place is that of a value which is left by the operations on held arguments."""


def _steps(
    function: ca.Function, arguments: NDArray[np.int64], results: NDArray[np.int64], held: Sequence[int]
) -> tuple[list[Step], list[Step], list[float], int]:
    """Operations on held arguments alone, the others, the numbers of the equations, how many values the first leave.

    Those values count from HELD up, intermediate ones from -1 down. What only fetches an argument or a number is no
    operation: whoever uses it reads it where it is.
    """
    number = {kind: k for k, kind in enumerate(OPERATIONS)}
    numbers: list[float] = []
    at: dict[int, int] = {}
    still: set[int] = set()
    once: list[Step] = []
    steps: list[Step] = []
    left = 0
    for k in range(function.n_instructions()):
        operation = CODES.get(function.instruction_id(k), "?")
        i, o = function.instruction_input(k), function.instruction_output(k)
        if operation == "INPUT":
            at[o[0]] = int(arguments[i[0]]) + i[1]
            if i[0] in held:
                still.add(at[o[0]])
        elif operation == "CONST":
            at[o[0]] = int(results[-1]) + len(numbers)
            still.add(at[o[0]])
            numbers.append(function.instruction_constant(k))
        elif operation == "OUTPUT":
            part = once if at[i[0]] in still else steps
            part.append((number["ASSIGN"], int(results[o[0]]) + o[1], at[i[0]], 0))
        elif operation in number:
            operands = [at[j] for j in i]
            if held and still.issuperset(operands):
                at[o[0]] = HELD + left
                left += 1
                still.add(at[o[0]])
                once.append((number[operation], at[o[0]], operands[0], operands[-1]))
                continue
            at[o[0]] = -1 - o[0]
            steps.append((number[operation], at[o[0]], operands[0], operands[-1]))
        else:
            raise CompileError(f"{function.name()} has the operation {operation}, which has no form in C")
    end = (number[END], 0, 0, 0)
    return [*once, end], [*steps, end], numbers, left


def _placed(code: NDArray[np.int64], first: int, left: int) -> NDArray[np.int64]:
    """Operations with places in memory: numbers end before `first`, then come `left` held values, then others."""
    at = code[:, 1:]
    code[:, 1:] = np.where(at >= HELD, first + at - HELD, np.where(at >= 0, at, first + left - 1 - at))
    return code
