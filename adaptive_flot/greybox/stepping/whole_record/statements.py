"""C statements of an SX function: one for each scalar operation. Numbers come from a table beside the code.

Two models of the same structure have the same statements: one library serves effects whose knots differ.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import casadi as ca

from adaptive_flot.greybox.stepping.compiled import CompileError

CODES = {getattr(ca, name): name[3:] for name in dir(ca) if name.startswith("OP_")}
UNARY: Mapping[str, str] = {
    **{"ASSIGN": "{0}", "NEG": "-{0}", "SQ": "{0}*{0}", "TWICE": "2.*{0}", "INV": "1./{0}", "NOT": "{0}==0."},
    **{"SIGN": "sign({0})", "FABS": "fabs({0})"},
    **{
        name: name.lower() + "({0})"
        for name in (
            *("EXP", "LOG", "SQRT", "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "SINH", "COSH", "TANH", "ASINH"),
            *("ACOSH", "ATANH", "FLOOR", "CEIL", "ERF", "LOG1P", "EXPM1"),
        )
    },
}
BINARY: Mapping[str, str] = {
    **{"ADD": "{0}+{1}", "SUB": "{0}-{1}", "MUL": "{0}*{1}", "DIV": "{0}/{1}"},
    **{"LT": "{0}<{1}", "LE": "{0}<={1}", "EQ": "{0}=={1}", "NE": "{0}!={1}"},
    **{"AND": "({0}!=0.)&({1}!=0.)", "OR": "({0}!=0.)|({1}!=0.)", "IF_ELSE_ZERO": "{0}!=0.?{1}:0."},
    **{"FMIN": "least({0},{1})", "FMAX": "most({0},{1})"},
    **{"POW": "power({0},{1})", "CONSTPOW": "power({0},{1})"},
    **{name: name.lower() + "({0},{1})" for name in ("FMOD", "REMAINDER", "ATAN2", "COPYSIGN", "HYPOT")},
}
HELPERS = """
static inline double sign(double x) { return x < 0. ? -1. : x > 0. ? 1. : x; }
static inline double least(double x, double y) { double r = x < y ? x : y; return y != y ? x : r; }
static inline double most(double x, double y) { double r = x > y ? x : y; return y != y ? x : r; }
#define power pow
"""
"""What the operations call beside the mathematical functions of C."""
STRUCTURAL = frozenset({0.0, 1.0, -1.0, 2.0, 0.5})
"""Numbers that stand in the code itself: they are part of the form of an equation."""


class Numbers:
    """The table of numbers of one library, in the order in which the code asks for them."""

    def __init__(self) -> None:
        self.values: list[float] = []

    def name(self, value: float) -> str:
        """What stands for a number in the code."""
        if value in STRUCTURAL:
            return repr(value)
        self.values.append(value)
        return f"c[{len(self.values) - 1}]"


def c_function(function: ca.Function, numbers: Numbers) -> str:
    """A C function `static void NAME(const double *i0, ..., const double *c, double *o0, ...)`.

    Raises
    ------
    CompileError
        It is no SX function, is not dense, or has an operation that has no form here.
    """
    name = function.name()
    if not function.is_a("SXFunction"):
        raise CompileError(f"{name} is no list of scalar operations")
    if any(function.nnz_in(i) != function.numel_in(i) for i in range(function.n_in())) or any(
        function.nnz_out(i) != function.numel_out(i) for i in range(function.n_out())
    ):
        raise CompileError(f"{name} has an argument or result that is not dense")
    given = [f"const double *restrict i{k}" for k in range(function.n_in())]
    made = [f"double *restrict o{k}" for k in range(function.n_out())]
    places: set[int] = set()
    body: list[str] = []
    for k in range(function.n_instructions()):
        operation = CODES.get(function.instruction_id(k), "?")
        i, o = function.instruction_input(k), function.instruction_output(k)
        if operation == "OUTPUT":
            body.append(f"o{o[0]}[{o[1]}]=a{i[0]};")
            continue
        places.add(o[0])
        if operation == "INPUT":
            body.append(f"a{o[0]}=i{i[0]}[{i[1]}];")
        elif operation == "CONST":
            body.append(f"a{o[0]}={_constant(function.instruction_constant(k), numbers)};")
        elif operation in UNARY or operation in BINARY:
            template = UNARY[operation] if operation in UNARY else BINARY[operation]
            body.append(f"a{o[0]}={template.format(*(f'a{j}' for j in i))};")
        else:
            raise CompileError(f"{name} has the operation {operation}, which has no form in C")
    declared = f"double {', '.join(f'a{place}' for place in sorted(places))};" if places else ""
    head = f"static void {name}({', '.join([*given, 'const double *restrict c', *made])}) {{"
    return "\n".join([head, declared, *body, "}"])


def _constant(value: float, numbers: Numbers) -> str:
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    return numbers.name(value)
