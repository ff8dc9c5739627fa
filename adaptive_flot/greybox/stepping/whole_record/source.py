"""C source of a whole record: the fast step (`fast_step.py`) from row to row, with derivatives if asked for.

The step's scalar operations are those of CasADi's expressions; its algebra over states and directions is loops, whose
innermost runs over the directions and becomes vector instructions. No sum is reordered, so that every machine gives
the same numbers.
"""

from __future__ import annotations

from collections.abc import Sequence

from adaptive_flot.greybox.stepping.whole_record.kernels import Kernels
from adaptive_flot.greybox.stepping.whole_record.statements import HELPERS, Numbers, c_function

_HEAD = """
#include <math.h>
#include <stdint.h>
#include <string.h>
enum {{ NX = {nx}, NU = {nu}, NY = {ny}, NS = {ns}, QP = {qp}, NR = {nr}, RX = {rx}, NE = {ne} }};
static const unsigned char decays[NX + 1] = {{{decays}}};
static const short rate_rows[] = {{{rate_rows}}}, rate_columns[] = {{{rate_columns}}};
static const short end_rows[] = {{{end_rows}}}, end_columns[] = {{{end_columns}}};
"""

_LOOPS = """
/* Derivatives (n, q) of values whose Jacobian by (state, parameters) is given by entries. */
static void chain(int64_t n, int64_t count, const short *rows, const short *columns, const double *restrict entry,
                  const double *restrict S, int64_t q, double *restrict out) {
    memset(out, 0, (size_t)(n * q) * sizeof(double));
    for (int64_t e = 0; e < count; e++) {
        double *restrict to = out + rows[e] * q;
        const double slope = entry[e];
        if (columns[e] >= NX) to[columns[e] - NX] += slope;
        else {
            const double *restrict from = S + columns[e] * q;
            for (int64_t j = 0; j < q; j++) to[j] += slope * from[j];
        }
    }
}

/* One step from (x, S) over h, with the inputs u held. `work` has room for ten matrices (NX, q). */
static void step(double t, double h, double *restrict x, double *restrict S, const double *u, const double *p,
                 const double *c, int64_t q, double *work) {
    const int64_t size = NX * q;
    double f[NX], r[NX], g[NX], entry[NR + 1], w[NX][12] = {{0}};
    double n1[NX], n2[NX], n3[NX], half[NX], a[NX], b[NX], d[NX];
    double *D1 = work, *DA = work + 2 * size, *DB = DA + size, *N1 = DB + size, *N2 = N1 + size, *N3 = N2 + size;
    double *HALF = N3 + size, *DD = HALF + size, *DN = DD + size;
    rates(x, &t, u, p, c, f, r, entry);
    if (q) chain(2 * NX, NR, rate_rows, rate_columns, entry, S, q, D1);
    const double *DF = D1, *DR = D1 + size;
    for (int i = 0; i < NX; i++) {
        double z = h * r[i];
        if (decays[i]) weights(&z, &h, c, w[i]);
        else {
            w[i][0] = w[i][2] = 1.; w[i][1] = h / 2; w[i][3] = w[i][5] = h / 6; w[i][4] = h / 3;
            for (int k = 6; k < 12; k++) w[i][k] = 0.;
        }
        for (int k = 6; k < 12; k++) w[i][k] *= h;
        n1[i] = f[i] - r[i] * x[i];
        half[i] = w[i][0] * x[i];
        a[i] = half[i] + w[i][1] * n1[i];
        for (int64_t j = i * q; j < (i + 1) * q; j++) {
            N1[j] = DF[j] - (r[i] * S[j] + x[i] * DR[j]);
            HALF[j] = w[i][0] * S[j] + x[i] * (w[i][6] * DR[j]);
            DA[j] = HALF[j] + (w[i][1] * N1[j] + n1[i] * (w[i][7] * DR[j]));
        }
    }
    double later = t + h / 2;
    rates(a, &later, u, p, c, f, g, entry);
    if (q) chain(NX, RX, rate_rows, rate_columns, entry, DA, q, DN);
    for (int i = 0; i < NX; i++) {
        n2[i] = f[i] - r[i] * a[i];
        b[i] = half[i] + w[i][1] * n2[i];
        for (int64_t j = i * q; j < (i + 1) * q; j++) {
            N2[j] = DN[j] - (r[i] * DA[j] + a[i] * DR[j]);
            DB[j] = HALF[j] + (w[i][1] * N2[j] + n2[i] * (w[i][7] * DR[j]));
        }
    }
    rates(b, &later, u, p, c, f, g, entry);
    if (q) chain(NX, RX, rate_rows, rate_columns, entry, DB, q, DN);
    for (int i = 0; i < NX; i++) {
        n3[i] = f[i] - r[i] * b[i];
        const double twice = 2. * n3[i] - n1[i];
        d[i] = w[i][0] * a[i] + w[i][1] * twice;
        for (int64_t j = i * q; j < (i + 1) * q; j++) {
            N3[j] = DN[j] - (r[i] * DB[j] + b[i] * DR[j]);
            DD[j] = (w[i][0] * DA[j] + a[i] * (w[i][6] * DR[j]))
                  + (w[i][1] * (2. * N3[j] - N1[j]) + twice * (w[i][7] * DR[j]));
        }
    }
    later = t + h;
    rates(d, &later, u, p, c, f, g, entry);
    if (q) chain(NX, RX, rate_rows, rate_columns, entry, DD, q, DN);
    for (int i = 0; i < NX; i++) {
        const double n4 = f[i] - r[i] * d[i], both = n2[i] + n3[i];
        for (int64_t j = i * q; j < (i + 1) * q; j++) {
            const double N4 = DN[j] - (r[i] * DD[j] + d[i] * DR[j]);
            S[j] = w[i][2] * S[j] + x[i] * (w[i][8] * DR[j])
                 + (w[i][3] * N1[j] + n1[i] * (w[i][9] * DR[j]))
                 + (w[i][4] * (N2[j] + N3[j]) + both * (w[i][10] * DR[j]))
                 + (w[i][5] * N4 + n4 * (w[i][11] * DR[j]));
        }
        x[i] = w[i][2] * x[i] + w[i][3] * n1[i] + w[i][4] * both + w[i][5] * n4;
    }
}

/* Rows of a record. Row k has inputs u[k] and, where dt is not above zero, its length as their last entry. A null
   pointer is what nobody wants. With `anew` the directions start again from S0 in every row. */
void run(int64_t rows, int64_t substeps, double dt, double t0, const double *x0, const double *S0, int64_t q,
         const double *inputs, const double *parameters, int64_t parameter_stride, const double *c, int64_t anew,
         double *states, double *outputs, double *signals, double *gradients, double *state_gradients, double *last,
         double *last_gradient, double *work) {
    double x[NX], y[NY + 1], s[NS + 1], entry[NE + 1], *S = work, elapsed = 0.;
    const int64_t width = dt > 0. ? NU : NU + 1;
    work += NX * q;
    memcpy(x, x0, sizeof x);
    if (q) memcpy(S, S0, (size_t)(NX * q) * sizeof(double));
    for (int64_t row = 0; row < rows; row++) {
        const double *u = inputs + row * width, *p = parameters + row * parameter_stride;
        const double length = dt > 0. ? dt : u[NU], h = length / (double)substeps;
        const double t = dt > 0. ? t0 + dt * (double)row : t0 + elapsed;
        if (q && anew) memcpy(S, S0, (size_t)(NX * q) * sizeof(double));
        for (int64_t i = 0; i < substeps; i++) step(t + (double)i * h, h, x, S, u, p, c, q, work);
        elapsed += length;
        const double at = t + length;
        ends(x, &at, u, p, c, outputs ? outputs + row * NY : y, signals ? signals + row * NS : s, entry);
        if (states) memcpy(states + row * NX, x, sizeof x);
        if (gradients) chain(NY, NE, end_rows, end_columns, entry, S, q, gradients + row * NY * q);
        if (state_gradients) memcpy(state_gradients + row * NX * q, S, (size_t)(NX * q) * sizeof(double));
    }
    memcpy(last, x, sizeof x);
    if (q) memcpy(last_gradient, S, (size_t)(NX * q) * sizeof(double));
}
"""


def record_source(kernels: Kernels, sizes: tuple[int, int, int, int], parameters: int) -> tuple[str, list[float]]:
    """C source of `run`, and the numbers that it takes as `c`.

    Parameters
    ----------
    kernels
        The functions of one step.
    sizes
        Numbers of states, inputs, outputs and signals.
    parameters
        Number of unknown parameters.

    Raises
    ------
    CompileError
        A function has an operation that has no form in C.
    """
    nx, nu, ny, ns = sizes
    numbers = Numbers()
    functions = [c_function(f, numbers) for f in (kernels.rates, kernels.ends, kernels.weights)]
    rate, end = kernels.rates_entries, kernels.ends_entries
    head = _HEAD.format(
        **{
            "nx": nx,
            "nu": nu,
            "ny": ny,
            "ns": ns,
            "qp": parameters,
            "nr": len(rate),
            "rx": sum(row < nx for row, _ in rate),
            "ne": len(end),
        },
        decays=", ".join(str(int(d)) for d in kernels.decays) or "0",
        rate_rows=_list([row for row, _ in rate]),
        rate_columns=_list([column for _, column in rate]),
        end_rows=_list([row for row, _ in end]),
        end_columns=_list([column for _, column in end]),
    )
    return "\n".join([head, HELPERS, *functions, _LOOPS]), numbers.values


def _list(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers)) or "0"
