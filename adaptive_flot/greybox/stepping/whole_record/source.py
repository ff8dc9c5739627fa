"""C source that runs any model over a whole record: the fast step (`fast_step.py`), with derivatives if asked for.

The step's scalar operations are those of CasADi's expressions, read from tapes or compiled. Its algebra over states and
directions is loops, whose innermost runs over the directions and becomes vector instructions. No sum is reordered, so
that every machine gives the same numbers.
"""

from __future__ import annotations

import hashlib
import inspect
import sys
from collections.abc import Mapping
from functools import lru_cache
from importlib.metadata import version

from adaptive_flot.greybox.stepping.compiling.compiled import Written
from adaptive_flot.greybox.stepping.whole_record import statements
from adaptive_flot.greybox.stepping.whole_record.statements import HELPERS
from adaptive_flot.greybox.stepping.whole_record.tape import END, ON_VECTORS, OPERATIONS, TEMPLATES, Tape

_TAPE = """
#include <math.h>
#include <stdint.h>
#include <string.h>
/* `compiled` and `compiled_held` are the tape as machine code, or null. */
typedef struct {
    const uint16_t *held, *code; double *memory; const int64_t *arguments, *results;
    void (*compiled_held)(const double *, double *), (*compiled)(const double *, double *);
} Tape;
static double *argument(const Tape *tape, int k) { return tape->memory + tape->arguments[k]; }
static double *result(const Tape *tape, int k) { return tape->memory + tape->results[k]; }
static void copy(double *to, const double *from, int64_t n) { memcpy(to, from, (size_t)n * sizeof(double)); }
"""

_HEAD = """
typedef struct {
    int64_t nx, nu, ny, ns, np, nr, rx, ne;
    const uint8_t *decays;
    const int16_t *rate_rows, *rate_columns, *end_rows, *end_columns;
    Tape rates, ends, near, far;
} Kernels;
"""

_RUN = """
static void run_held(const Tape *tape) {
    if (tape->compiled_held) tape->compiled_held(tape->memory, tape->memory);
    else evaluate(tape->held, tape->memory);
}

static void run_tape(const Tape *tape) {
    if (tape->compiled) tape->compiled(tape->memory, tape->memory);
    else evaluate(tape->code, tape->memory);
}
"""

_LOOPS = """
/* Inputs and parameters of a row: they stay where rates and ends read them, with what depends on them alone. */
static void hold(const Tape *tape, const Kernels *k, const double *u, const double *p) {
    copy(argument(tape, 2), u, k->nu);
    copy(argument(tape, 3), p, k->np);
    run_held(tape);
}

static int same(const double *one, const double *other, int64_t n) {
    return memcmp(one, other, (size_t)n * sizeof(double)) == 0;
}

static void evaluate_at(const Tape *tape, const Kernels *k, const double *x, double t) {
    copy(argument(tape, 0), x, k->nx);
    *argument(tape, 1) = t;
    run_tape(tape);
}

/* Derivatives (n, q) of values whose Jacobian by (state, parameters) is given by entries. */
static void chain(int64_t nx, int64_t n, int64_t count, const int16_t *rows, const int16_t *columns,
                  const double *restrict entry, const double *restrict S, int64_t q, double *restrict out) {
    memset(out, 0, (size_t)(n * q) * sizeof(double));
    for (int64_t e = 0; e < count; e++) {
        double *restrict to = out + rows[e] * q;
        const double slope = entry[e];
        if (columns[e] >= nx) to[columns[e] - nx] += slope;
        else {
            const double *restrict from = S + columns[e] * q;
            for (int64_t j = 0; j < q; j++) to[j] += slope * from[j];
        }
    }
}

/* One step from (x, S) over h, with the inputs held. `work` has room for ten matrices (nx, q). */
static void step(const Kernels *K, double t, double h, double *restrict x, double *restrict S, int64_t q,
                 double *work) {
    const int64_t nx = K->nx, size = nx * q;
    double r[nx], w[nx][12], n1[nx], n2[nx], n3[nx], half[nx], a[nx], b[nx], d[nx];
    double *D1 = work, *DA = work + 2 * size, *DB = DA + size, *N1 = DB + size, *N2 = N1 + size, *N3 = N2 + size;
    double *HALF = N3 + size, *DD = HALF + size, *DN = DD + size;
    const double *f = result(&K->rates, 0), *entry = result(&K->rates, 2);
    evaluate_at(&K->rates, K, x, t);
    copy(r, result(&K->rates, 1), nx);
    if (q) chain(nx, 2 * nx, K->nr, K->rate_rows, K->rate_columns, entry, S, q, D1);
    const double *DF = D1, *DR = D1 + size;
    for (int i = 0; i < nx; i++) {
        memset(w[i], 0, sizeof w[i]);
        if (K->decays[i]) {
            const Tape *weights = K->decays[i] < 2 || h * r[i] > -1. ? &K->near : &K->far;
            *argument(weights, 0) = h * r[i];
            *argument(weights, 1) = h;
            *argument(weights, 2) = h * r[i];
            run_tape(weights);
            copy(w[i], result(weights, 0), q ? 12 : 6);
        }
        else {
            w[i][0] = w[i][2] = 1.; w[i][1] = h / 2; w[i][3] = w[i][5] = h / 6; w[i][4] = h / 3;
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
    evaluate_at(&K->rates, K, a, t + h / 2);
    if (q) chain(nx, nx, K->rx, K->rate_rows, K->rate_columns, entry, DA, q, DN);
    for (int i = 0; i < nx; i++) {
        n2[i] = f[i] - r[i] * a[i];
        b[i] = half[i] + w[i][1] * n2[i];
        for (int64_t j = i * q; j < (i + 1) * q; j++) {
            N2[j] = DN[j] - (r[i] * DA[j] + a[i] * DR[j]);
            DB[j] = HALF[j] + (w[i][1] * N2[j] + n2[i] * (w[i][7] * DR[j]));
        }
    }
    evaluate_at(&K->rates, K, b, t + h / 2);
    if (q) chain(nx, nx, K->rx, K->rate_rows, K->rate_columns, entry, DB, q, DN);
    for (int i = 0; i < nx; i++) {
        n3[i] = f[i] - r[i] * b[i];
        const double twice = 2. * n3[i] - n1[i];
        d[i] = w[i][0] * a[i] + w[i][1] * twice;
        for (int64_t j = i * q; j < (i + 1) * q; j++) {
            N3[j] = DN[j] - (r[i] * DB[j] + b[i] * DR[j]);
            DD[j] = (w[i][0] * DA[j] + a[i] * (w[i][6] * DR[j]))
                  + (w[i][1] * (2. * N3[j] - N1[j]) + twice * (w[i][7] * DR[j]));
        }
    }
    evaluate_at(&K->rates, K, d, t + h);
    if (q) chain(nx, nx, K->rx, K->rate_rows, K->rate_columns, entry, DD, q, DN);
    for (int i = 0; i < nx; i++) {
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
void run(const Kernels *K, int64_t rows, int64_t substeps, double dt, double t0, const double *x0, const double *S0,
         int64_t q, const double *inputs, const double *parameters, int64_t parameter_stride, int64_t anew,
         double *states, double *outputs, double *signals, double *gradients, double *state_gradients, double *last,
         double *last_gradient, double *work) {
    const int64_t nx = K->nx, size = nx * q, width = dt > 0. ? K->nu : K->nu + 1;
    double x[nx], *S = work, elapsed = 0.;
    work += size;
    copy(x, x0, nx);
    if (q) copy(S, S0, size);
    for (int64_t row = 0; row < rows; row++) {
        const double *u = inputs + row * width, *p = parameters + row * parameter_stride;
        const double length = dt > 0. ? dt : u[K->nu], h = length / (double)substeps;
        const double t = dt > 0. ? t0 + dt * (double)row : t0 + elapsed;
        if (q && anew) copy(S, S0, size);
        if (!row || !same(u, u - width, K->nu) || !same(p, p - parameter_stride, K->np)) {
            hold(&K->rates, K, u, p);
            hold(&K->ends, K, u, p);
        }
        for (int64_t i = 0; i < substeps; i++) step(K, t + (double)i * h, h, x, S, q, work);
        elapsed += length;
        evaluate_at(&K->ends, K, x, t + length);
        if (outputs) copy(outputs + row * K->ny, result(&K->ends, 0), K->ny);
        if (signals) copy(signals + row * K->ns, result(&K->ends, 1), K->ns);
        if (states) copy(states + row * nx, x, nx);
        if (gradients)
            chain(nx, K->ny, K->ne, K->end_rows, K->end_columns, result(&K->ends, 2), S, q,
                  gradients + row * K->ny * q);
        if (state_gradients) copy(state_gradients + row * size, S, size);
    }
    copy(last, x, nx);
    if (q) copy(last_gradient, S, size);
}
"""

_RECURSION = """
/* Steps before each row: the state and its derivatives, from the start of the row over so many steps. */
typedef struct {
    Tape tape;
    int64_t times, state, derivatives, inputs, parameters, to_state, to_derivatives, of_time, of_inputs, of_parameters;
    double length; const double *start;
} Steps;

static double *at(const Tape *tape, int64_t k) { return tape->memory + tape->arguments[k] * LANES; }
static double *out(const Tape *tape, int64_t k) { return tape->memory + tape->results[k] * LANES; }

/* A row's steps, from its state (its first argument) and the derivatives at its start, with its inputs held. */
static void advance(const Steps *steps, const Tape *row, int64_t first) {
    const Tape *tape = &steps->tape;
    copy(at(tape, 0), at(row, 0), steps->state * LANES);
    for (int64_t e = 0; e < steps->derivatives; e++)
        for (int l = 0; l < LANES; l++) at(tape, 1)[e * LANES + l] = steps->start[e];
    copy(at(tape, 3), at(row, steps->of_inputs), steps->inputs * LANES);
    if (first) copy(at(tape, 4), at(row, steps->of_parameters), steps->parameters * LANES);
    run_held(tape);
    for (int64_t i = 0; i < steps->times; i++) {
        for (int l = 0; l < LANES; l++) at(tape, 2)[l] = at(row, steps->of_time)[l] + (double)i * steps->length;
        if (i) {
            copy(at(tape, 0), out(tape, 0), steps->state * LANES);
            copy(at(tape, 1), out(tape, 1), steps->derivatives * LANES);
        }
        run_tape(tape);
    }
    copy(at(row, steps->to_state), out(tape, 0), steps->state * LANES);
    copy(at(row, steps->to_derivatives), out(tape, 1), steps->derivatives * LANES);
}

/* The tape for each of so many rows, for LANES members at once, after `steps` where these are not null. The first
   `carried` arguments are the first results of the row before. Member l has its k-th argument at
   `values[k * LANES + l]`; a stride of zero is an argument that stays. The j-th of the results that are wanted goes to
   `found[j * LANES + l]`, row by row. A place of the memory holds the numbers of all members beside each other. */
void recur(const Tape *tape, const Steps *steps, int64_t rows, int64_t given, int64_t carried, const int64_t *sizes,
           const double *const *values, const int64_t *strides, int64_t made, const int64_t *wanted,
           const int64_t *widths, double *const *found) {
    for (int64_t row = 0; row < rows; row++) {
        for (int64_t k = 0; k < given; k++) {
            if (row && k < carried) copy(at(tape, k), out(tape, k), sizes[k] * LANES);
            else if (!row || strides[k])
                for (int l = 0; l < LANES; l++) {
                    const double *from = values[k * LANES + l] + row * strides[k];
                    for (int64_t e = 0; e < sizes[k]; e++) at(tape, k)[e * LANES + l] = from[e];
                }
        }
        if (!row) run_held(tape);
        if (steps) advance(steps, tape, !row);
        run_tape(tape);
        for (int64_t j = 0; j < made; j++)
            for (int l = 0; l < LANES; l++)
                for (int64_t e = 0; e < widths[j]; e++)
                    found[j * LANES + l][row * widths[j] + e] = out(tape, wanted[j])[e * LANES + l];
    }
}
"""


def _evaluation(lanes: int = 1) -> str:
    """The function that reads a tape: from one operation it goes straight to the next; with a lane for each member."""
    jumps = ", ".join(f"&&do_{kind}" for kind in OPERATIONS)
    one, many = "m[c[1]] = {};", "IN_LANES({})"
    operands = ("m[c[2]]", "m[c[3]]") if lanes == 1 else ("a[l]", "b[l]")
    cases = [
        f"do_{kind}: {(one if lanes == 1 else many).format(TEMPLATES[kind].format(*operands))} c += 4; goto *go[c[0]];"
        for kind in OPERATIONS
        if kind != END
    ]
    return "\n".join([
        f"#define LANES {lanes}",
        "#define IN_LANES(value) { const double *a = m + c[2] * LANES, *b = m + c[3] * LANES; double r[LANES]; \\",
        "    for (int l = 0; l < LANES; l++) r[l] = value; (void)b; memcpy(m + c[1] * LANES, r, sizeof r); }",
        "static void evaluate(const uint16_t *c, double *const m) {",
        f"static const void *const go[] = {{{jumps}}};",
        "goto *go[c[0]];",
        *cases,
        f"do_{END}: return;",
        "}",
    ])  # fmt: skip


RECORD_SOURCE = "\n".join([_TAPE, _HEAD, HELPERS, _evaluation(), _RUN, _LOOPS])
"""The whole of it, the same for every model."""


def recursion_source(lanes: int = 1) -> str:
    """Any function whose results are arguments of its next call, for so many members at once.

    Each member has arguments of its own, and the numbers that it has alone.
    """
    return "\n".join([_TAPE, HELPERS, _evaluation(lanes), _RUN, _RECURSION])


def kernel_source(tapes: Mapping[str, Tape]) -> Written:
    """C source of tapes as functions of their names, for a model that runs many times."""

    def write() -> str:
        return "\n".join(["#include <math.h>", HELPERS, *(tape.c_functions(name) for name, tape in tapes.items())])

    return Written(_key(1, tapes), write)


def kernel_source_in_lanes(name: str, tape: Tape, lanes: int) -> Written:
    """The same of one tape for so many members, see `_in_lanes`."""
    return Written(_key(lanes, {name: tape}), lambda: _in_lanes(name, tape, lanes))


def _key(lanes: int, tapes: Mapping[str, Tape]) -> str:
    return " ".join([_writer(), str(lanes), *(f"{name} {tape.digest}" for name, tape in tapes.items())])


@lru_cache(maxsize=1)
def _writer() -> str:
    """What writes the source, as one number: a library of another version of it is another one."""
    modules = (sys.modules[name] for name in (__name__, Tape.__module__, statements.__name__))
    try:
        program = "".join(map(inspect.getsource, modules))
    except OSError:  # installed without its source
        program = version("adaptive-flot")
    return hashlib.sha256(program.encode()).hexdigest()


def _in_lanes(name: str, tape: Tape, lanes: int) -> str:
    """C source of one tape for so many members, whose numbers lie beside each other in the memory.

    Sums, products and the like are operations on vectors. The others are called for each member. The numbers are those
    of one member, to the bit.
    """
    kinds = sorted({OPERATIONS[kind] for part in (tape.held, tape.code) for kind in part[:, 0].tolist()} - {END})
    calls = [
        f"static CALLED V do_{kind}(const V x, const V y) {{ V r; "
        f"for (int l = 0; l < {lanes}; l++) r[l] = {TEMPLATES[kind].format('x[l]', 'y[l]')}; return r; }}"
        for kind in kinds
        if kind not in ON_VECTORS
    ]
    return "\n".join([
        "#include <math.h>",
        "#define CALLED __attribute__((noinline, unused))",
        f"typedef double V __attribute__((vector_size({8 * lanes}), aligned(8)));",
        HELPERS,
        *calls,
        tape.c_functions(name, in_lanes=True),
    ])  # fmt: skip
