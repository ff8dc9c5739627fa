"""C source of a CasADi function for several members at once: one lane of a vector register for each member.

The SX expression is a list of scalar operations. Each becomes a statement in a loop over the lanes, the member index
innermost, and the compiler makes vector instructions of the loop. `exp`, `log` and the like are those of glibc's
vector library (libmvec, at most 4 units in the last place off). There a power takes as long as 70 multiplications, so
x^y is exp(y log|x|) with the signs and special values of C. Its relative error stays below 2e-13 over the whole range.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import casadi as ca

from adaptive_flot.greybox.stepping.compiling.compiled import CompileError
from adaptive_flot.greybox.stepping.whole_record.statements import BINARY, CODES, UNARY

_HEAD = """
#include <math.h>
#include <stdint.h>
#define L {lanes}
#define INLINE static inline __attribute__((always_inline)) /* else the loop is none of vector instructions */
{simd}
INLINE double sign(double x) {{ return x < 0. ? -1. : x > 0. ? 1. : x; }}
INLINE double least(double x, double y) {{ double r = x < y ? x : y; return y != y ? x : r; }}
INLINE double most(double x, double y) {{ double r = x > y ? x : y; return y != y ? x : r; }}
{power}
"""
_VECTOR_FUNCTIONS = (
    *("exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh"),
    *("erf", "log1p", "expm1"),
)
_VECTOR_PAIRS = ("atan2", "hypot")
_DECLARED = "#pragma omp declare simd notinbranch simdlen(L)\nextern double {0}({1}) __attribute__((const));"
_SCALAR_POWER = "#define power pow"
_VECTOR_POWER = """
INLINE double power(double x, double y) {
    double size = log(fabs(x)), exponent = y * size;
    double whole = floor(y) == y, even = floor(0.5 * y) == 0.5 * y, below = x < 0.;
    exponent = (y == 0.) | (size == 0.) ? 0. : exponent;                       /* 1, whatever the other argument */
    double side = 1. + (whole - even) * (copysign(1., x) - 1.);                /* -1 for an odd power of a negative x */
    double r = side * exp(exponent);
    return below - below * whole > 0. ? NAN : r;
}
"""
"""Few branches, and none inside another: from nested ones compilers make jumps, and then no vector instructions."""

_DRIVER = """
static const int64_t arg_size[] = {{{arg_sizes}}}, res_size[] = {{{res_sizes}}}, carried[] = {{{carried}}};

/* Rows of the members of blocks first to last - 1. Strides, in numbers: of rows, entries and members of each array. */
void run(const double *const *arg, const int64_t *arg_stride, double *const *res, const int64_t *res_stride,
         int64_t members, int64_t rows, int64_t first, int64_t last) {{
    _Alignas(64) double in[{n_in}][L];
    _Alignas(64) double out[{n_out}][L];
    for (int64_t block = first; block < last; block++) {{
        const int64_t start = block * L, count = members - start < L ? members - start : L;
        for (int64_t row = 0; row < rows; row++) {{
            int64_t at = 0;
            for (int64_t i = 0; i < {n_arg}; at += arg_size[i++]) {{
                const int64_t *stride = arg_stride + 3 * i;
                if (row && carried[i] >= 0) {{
                    for (int64_t e = 0; e < arg_size[i]; e++)
                        for (int l = 0; l < L; l++) in[at + e][l] = out[carried[i] + e][l];
                }} else if (!row || stride[0]) {{
                    const double *from = arg[i] + row * stride[0] + start * stride[2];
                    for (int64_t e = 0; e < arg_size[i]; e++)
                        for (int l = 0; l < L; l++)
                            in[at + e][l] = from[e * stride[1] + (l < count ? l : count - 1) * stride[2]];
                }}
            }}
            kernel(in, out);
            at = 0;
            for (int64_t i = 0; i < {n_res}; at += res_size[i++]) {{
                const int64_t *stride = res_stride + 3 * i;
                if (!res[i] || (!stride[0] && row < rows - 1)) continue;
                double *to = res[i] + row * stride[0] + start * stride[2];
                for (int64_t e = 0; e < res_size[i]; e++)
                    for (int64_t l = 0; l < count; l++) to[e * stride[1] + l * stride[2]] = out[at + e][l];
            }}
        }}
    }}
}}
"""


def lane_source(function: ca.Function, carried: Sequence[int], lanes: int) -> str:
    """C source of `run`, which evaluates a function for blocks of members over many rows.

    Parameters
    ----------
    function
        An SX function with dense arguments and results.
    carried
        For each argument the index of the result that takes its place in the next row, or -1.
    lanes
        Members in a block. With one the code is plain C, whose results are CasADi's own to the bit.

    Raises
    ------
    CompileError
        It is no SX function, is not dense, or has an operation that has no form in lanes.
    """
    if not function.is_a("SXFunction"):
        raise CompileError(f"{function.name()} is no list of scalar operations")
    sizes = [function.nnz_in(i) for i in range(function.n_in())]
    results = [function.nnz_out(i) for i in range(function.n_out())]
    if sizes != [function.numel_in(i) for i in range(len(sizes))] or results != [
        function.numel_out(i) for i in range(len(results))
    ]:
        raise CompileError(f"{function.name()} has an argument or result that is not dense")
    ends = [sum(results[:i]) for i in range(len(results))]
    simd, before = "", ""
    if lanes > 1:
        simd = "\n".join(
            [
                *(_DECLARED.format(name, "double") for name in _VECTOR_FUNCTIONS),
                *(_DECLARED.format(name, "double, double") for name in _VECTOR_PAIRS),
            ]
        )
        before = "#pragma omp simd simdlen(L)"
    head = _HEAD.format(lanes=lanes, simd=simd, power=_SCALAR_POWER if lanes == 1 else _VECTOR_POWER)
    slots, body = _statements(function, [sum(sizes[:i]) for i in range(len(sizes))], ends)
    kernel = [
        "static void kernel(const double (*restrict in)[L], double (*restrict out)[L]) {",
        before,
        "for (int l = 0; l < L; l++) {",
        f"double {', '.join(f'a{slot}' for slot in slots)};" if slots else "",
        *body,
        "}}",
    ]
    driver = _DRIVER.format(
        arg_sizes=", ".join(map(str, sizes)),
        res_sizes=", ".join(map(str, results)),
        carried=", ".join(str(-1 if i < 0 else ends[i]) for i in carried),
        **{"n_in": max(1, sum(sizes)), "n_out": max(1, sum(results)), "n_arg": len(sizes), "n_res": len(results)},
    )
    return "\n".join([head, *kernel, driver])


def _statements(function: ca.Function, starts: Sequence[int], ends: Sequence[int]) -> tuple[list[int], list[str]]:
    """Work places of the expression, and one statement for each operation."""
    places: set[int] = set()
    body: list[str] = []
    make: dict[str, Callable[[list[int], list[int], int], str]] = {
        "INPUT": lambda i, o, k: f"a{o[0]}=in[{starts[i[0]] + i[1]}][l];",
        "OUTPUT": lambda i, o, k: f"out[{ends[o[0]] + o[1]}][l]=a{i[0]};",
        "CONST": lambda i, o, k: f"a{o[0]}={_number(function.instruction_constant(k))};",
    }
    for k in range(function.n_instructions()):
        name = CODES.get(function.instruction_id(k), "?")
        i, o = function.instruction_input(k), function.instruction_output(k)
        if name in make:
            body.append(make[name](i, o, k))
        elif name in UNARY or name in BINARY:
            template = UNARY[name] if name in UNARY else BINARY[name]
            body.append(f"a{o[0]}={template.format(*(f'a{j}' for j in i))};")
        else:
            raise CompileError(f"{function.name()} has the operation {name}, which has no form in lanes")
        if name != "OUTPUT":
            places.add(o[0])
    return sorted(places), body


def _number(value: float) -> str:
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    return float(value).hex()
