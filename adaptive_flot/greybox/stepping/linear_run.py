"""Responses of a linearised run to many profiles at once: one recursion from row to row, as machine code where wanted.

With the Jacobians of each interval, the derivatives S of the state along r columns, and what acts in the interval, v::

    out_k = C_k S + H_k v_k,        S <- A_k S + G_k v_k
"""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adaptive_flot.greybox.quantities import FloatArray
from adaptive_flot.greybox.stepping.compiling.compiled import FLAGS, CompileError, load_library

_SOURCE = """
#include <stdint.h>
#include <string.h>
static void apply(int64_t rows, int64_t inner, int64_t r, const double *restrict M, const double *restrict S,
                  double *restrict out) {
    for (int64_t i = 0; i < rows; i++, out += r) {
        memset(out, 0, (size_t)r * sizeof(double));
        for (int64_t k = 0; k < inner; k++) {
            const double factor = M[i * inner + k], *restrict from = S + k * r;
            if (factor != 0.) for (int64_t j = 0; j < r; j++) out[j] += factor * from[j];
        }
    }
}
static void push(int64_t rows, int64_t q, int64_t r, int64_t count, const double *restrict M,
                 const int64_t *restrict source, const double *restrict v, double *restrict out) {
    for (int64_t i = 0; i < rows; i++, out += r, M += q)
        for (int64_t j = 0; j < count; j++) out[j] += M[source[j]] * v[j];
}
void run(int64_t n, int64_t nx, int64_t m, int64_t q, int64_t r, int64_t count, const double *A, const double *G,
         const double *C, const double *H, const int64_t *source, const double *v, double *S, double *next,
         double *out) {
    for (int64_t k = 0; k < n; k++) {
        apply(m, nx, r, C + k * m * nx, S, out + k * m * r);
        push(m, q, r, count, H + k * m * q, source, v + k * count, out + k * m * r);
        apply(nx, nx, r, A + k * nx * nx, S, next);
        push(nx, q, r, count, G + k * nx * q, source, v + k * count, next);
        memcpy(S, next, (size_t)(nx * r) * sizeof(double));
    }
}
"""


def linear_run(
    jacobians: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    start: FloatArray,
    source: NDArray[np.intp],
    acting: FloatArray,
    *,
    as_machine_code: bool = False,
) -> FloatArray:
    """Derivatives of the outputs (n, m, r) at the end of each interval.

    Parameters
    ----------
    jacobians
        A (n, nx, nx), G (n, nx, q), C (n, m, nx), H (n, m, q) of each interval.
    start
        Derivatives S of the state at the start (nx, r).
    source
        For each of the first columns, (count,), the column of G and H by which something acts.
    acting
        What acts in each interval (n, count), count <= r.
    as_machine_code
        Through the compiler where there is one; sums are then taken in another order.
    """
    A, G, C, H = jacobians
    n, m, r, count = len(A), C.shape[1], start.shape[1], len(source)
    library = _library() if as_machine_code else None
    if library is not None:
        whole = [np.ascontiguousarray(x, dtype=float) for x in (A, G, C, H)]
        v, S, where = np.ascontiguousarray(acting), np.array(start, order="C"), np.ascontiguousarray(source, np.int64)
        out, scratch = np.empty((n, m, r)), np.empty_like(S)
        sizes = n, S.shape[0], m, G.shape[2], r, count
        library(*sizes, *(ctypes.c_void_p(x.ctypes.data) for x in (*whole, where, v, S, scratch, out)))
        return out
    S, out = start, np.empty((n, m, r))
    for k in range(n):
        np.matmul(C[k], S, out=out[k])
        out[k][:, :count] += H[k][:, source] * acting[k]
        S = A[k] @ S
        S[:, :count] += G[k][:, source] * acting[k]
    return out


@cache
def _library() -> Any:
    try:
        return load_library("linear_run", _SOURCE, (*FLAGS, "-ftree-vectorize"), _open)
    except CompileError:
        return None


def _open(library: Path) -> Any:
    run = ctypes.CDLL(str(library)).run
    run.argtypes, run.restype = [ctypes.c_int64] * 6 + [ctypes.c_void_p] * 9, None
    return run
