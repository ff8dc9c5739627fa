"""A compiled function called for one member after the other, over many rows, with nothing of Python between the rows.

For a function that is too large to be compiled in lanes, or is no list of scalar operations. It takes the library that
the function has anyway, where it is called row by row, so the compiler has no more to do. The results are the same to
the bit.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import partial

import casadi as ca

from adaptive_flot.greybox.ensemble.lane_library import LaneLibrary, opened
from adaptive_flot.greybox.stepping.compiling.compiled import FLAGS, CompileError, library_of, load_library
from adaptive_flot.greybox.stepping.whole_record.instruction_sets import SCALAR

_SOURCE = """
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
typedef int (*function)(const double **, double **, long long *, double *, int);

/* What a function is: its sizes of arguments and results, the result that takes the place of each argument or -1, and
   how much room it needs for pointers, integers and numbers. */
typedef struct {
    function call;
    int64_t n_arg, n_res;
    const int64_t *arg_size, *res_size, *carried;
    int64_t room_arg, room_res, room_integers, room_numbers;
} description;

/* Rows of the members first to last - 1. Strides, in numbers: of rows, entries and members of each array. */
void run(const description *f, const double *const *arg, const int64_t *arg_stride, double *const *res,
         const int64_t *res_stride, int64_t members, int64_t rows, int64_t first, int64_t last) {
    int64_t given = 0, made = 0, at;
    for (int64_t i = 0; i < f->n_arg; i++) given += f->arg_size[i];
    for (int64_t i = 0; i < f->n_res; i++) made += f->res_size[i];
    double *numbers = malloc((given + made + f->room_numbers + 1) * sizeof(double));
    long long *integers = malloc((f->room_integers + 1) * sizeof(long long));
    const double **in = malloc((f->room_arg + 1) * sizeof(double *));
    double **out = malloc((f->room_res + 1) * sizeof(double *));
    double *inputs = numbers, *outputs = numbers + given, *work = outputs + made;
    const int no_room = !(numbers && integers && in && out); /* then nothing is a number */
    for (int64_t i = 0; no_room && i < f->n_res; i++)
        for (int64_t member = first; res[i] && member < last; member++)
            for (int64_t row = 0; row < (res_stride[3 * i] ? rows : 1); row++)
                for (int64_t e = 0; e < f->res_size[i]; e++)
                    res[i][row * res_stride[3 * i] + e * res_stride[3 * i + 1] + member * res_stride[3 * i + 2]] = NAN;
    for (int64_t member = first; !no_room && member < last; member++)
        for (int64_t row = 0; row < rows; row++) {
            at = 0;
            for (int64_t i = 0; i < f->n_arg; at += f->arg_size[i++]) {
                const int64_t *stride = arg_stride + 3 * i;
                if (row && f->carried[i] >= 0) {
                    int64_t from = 0;
                    for (int64_t j = 0; j < f->carried[i]; j++) from += f->res_size[j];
                    memcpy(inputs + at, outputs + from, f->arg_size[i] * sizeof(double));
                } else if (!row || stride[0]) {
                    const double *from = arg[i] + row * stride[0] + member * stride[2];
                    for (int64_t e = 0; e < f->arg_size[i]; e++) inputs[at + e] = from[e * stride[1]];
                }
            }
            at = 0;
            for (int64_t i = 0; i < f->n_arg; at += f->arg_size[i++]) in[i] = inputs + at;
            at = 0;
            for (int64_t i = 0; i < f->n_res; at += f->res_size[i++]) out[i] = outputs + at;
            const int failed = f->call(in, out, integers, work, 0);
            if (failed) for (int64_t e = 0; e < made; e++) outputs[e] = NAN;
            at = 0;
            for (int64_t i = 0; i < f->n_res; at += f->res_size[i++]) {
                const int64_t *stride = res_stride + 3 * i;
                if (!res[i] || (!stride[0] && row < rows - 1)) continue;
                double *to = res[i] + row * stride[0] + member * stride[2];
                for (int64_t e = 0; e < f->res_size[i]; e++) to[e * stride[1]] = outputs[at + e];
            }
        }
    free(numbers), free(integers), free(in), free(out);
}
"""


class _Description(ctypes.Structure):
    _fields_ = (
        ("call", ctypes.c_void_p),
        *((name, ctypes.c_int64) for name in ("n_arg", "n_res")),
        *((name, ctypes.POINTER(ctypes.c_int64)) for name in ("arg_size", "res_size", "carried")),
        *((name, ctypes.c_int64) for name in ("room_arg", "room_res", "room_integers", "room_numbers")),
    )


class LoopLibrary(LaneLibrary):
    """Machine code of a function, one member at a time; called as a `LaneLibrary` is.

    Parameters
    ----------
    function
        Any function with dense arguments and results of which CasADi writes C.
    carried
        For each argument the index of the result that takes its place in the next row, or -1.

    Raises
    ------
    CompileError
        It is not dense, or can not be compiled or loaded.
    """

    def __init__(self, function: ca.Function, carried: Sequence[int]) -> None:
        name, inputs, outputs = function.name(), range(function.n_in()), range(function.n_out())
        if not all(function.sparsity_in(i).is_dense() for i in inputs) or not all(
            function.sparsity_out(i).is_dense() for i in outputs
        ):
            raise CompileError(f"{name} has an argument or result that is not dense")
        self.instructions, self._library = SCALAR, library_of(function)
        room = (ctypes.c_longlong * 4)()
        work = getattr(self._library, f"{name}_work")
        work(*(ctypes.byref(room, k * ctypes.sizeof(ctypes.c_longlong)) for k in range(4)))
        self._tables = [
            _integers([function.nnz_in(i) for i in inputs]),
            _integers([function.nnz_out(i) for i in outputs]),
            _integers(carried),
        ]
        address = ctypes.cast(getattr(self._library, name), ctypes.c_void_p)
        self._description = _Description(address, len(inputs), len(outputs), *self._tables, *room)
        run = opened(load_library("record_loop", _SOURCE, FLAGS, lambda library: ctypes.CDLL(str(library))), 5)
        self._run = partial(run, ctypes.byref(self._description))


def _integers(values: Sequence[int]) -> ctypes.Array[ctypes.c_int64]:
    return (ctypes.c_int64 * max(1, len(values)))(*values)
