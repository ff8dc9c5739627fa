"""The filter of a record for other sizes of the noise than one that it was run for, by the derivatives along that run.

Other noise moves the filter by d_k from where it was, z_k. With the derivatives F and H of next state and outputs that
the run took at z_k, and its innovations e_k::

    e'_{k+1} = e_{k+1} - H_k d_k
    z'_{k+1} = f(z_k) + F_k (d_k + K'_k e'_{k+1})        d_{k+1} = z'_{k+1} - z_{k+1}

Exact for a linear model, and at the noise of the run. A row needs no integration of the model, which is most of the
time of a filter. Maybeck, *Stochastic Models, Estimation, and Control* 2 (1982), 9.5, on filters about a given course.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from contextlib import suppress
from functools import lru_cache

import casadi as ca
import numpy as np

from adaptive_flot.greybox.filtering.step import correct
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.compiled import CompileError
from adaptive_flot.greybox.stepping.recursion import RowByRow, row_by_row
from adaptive_flot.greybox.stepping.whole_record.tape_recursion import TapeRecursion


def linearised_step(states: int, outputs: int, nu: float) -> ca.Function:
    """Build the step for n states and m outputs, whose innovations have nu degrees of freedom.

    Returns
    -------
    casadi.Function
        ``(d (n,), P (n, n), F (n n,), H (m n,), error (m,), shift (n,), there (m,), Q (n,), r (m,)) -> (d_next, P_next,
        log_likelihood)``: F and H column by column, error the innovations of the run, and shift what they corrected.
    """
    n, m = states, outputs
    d, P, F, H = ca.SX.sym("d", n), ca.SX.sym("P", n, n), ca.SX.sym("F", n * n), ca.SX.sym("H", m * n)
    error, shift, there = ca.SX.sym("error", m), ca.SX.sym("shift", n), ca.SX.sym("there", m)
    Q, r = ca.SX.sym("Q", n), ca.SX.sym("r", m)
    by_state, shown = ca.reshape(F, n, n), ca.reshape(H, m, n)
    moved, corrected, likelihood = correct(P + ca.diag(Q), shown, error - shown @ d, r, there, nu)
    carried = by_state @ corrected @ by_state.T
    return ca.Function(
        "linearised_step",
        [d, P, F, H, error, shift, there, Q, r],
        [by_state @ (d + moved) - shift, (carried + carried.T) / 2, likelihood],
        ["d", "P", "F", "H", "error", "shift", "there", "Q", "r"],
        ["d_next", "P_next", "log_likelihood"],
    )


@lru_cache(maxsize=64)
def _many(states: int, outputs: int, nu: float, thread: int) -> RowByRow:
    """The step from row to row, with its working memory: that of one thread."""
    del thread
    return row_by_row(linearised_step(states, outputs, nu), {"d": "d_next", "P": "P_next"}, ("Q", "r"))


def by_columns(matrices: FloatArray) -> FloatArray:
    """Matrices (K, n, m) as rows of numbers, column by column (K, m n)."""
    return matrices.transpose(0, 2, 1).reshape(len(matrices), -1)


def log_likelihoods(
    along: dict[str, FloatArray],
    starts: Sequence[tuple[FloatArray, FloatArray]],
    noises: Sequence[tuple[FloatArray, FloatArray]],
    nu: float,
) -> FloatArray:
    """Log-densities of the rows after the first (cases, N - 1).

    Parameters
    ----------
    along
        What all cases share, a row each: F, H, error, shift and there of `linearised_step`.
    starts
        d (n,) and P (n, n) after the first row, of each case.
    noises
        Q (n,) and r (m,) of each case.
    nu
        Degrees of freedom of the innovations.
    """
    n, m = along["shift"].shape[1], along["error"].shape[1]
    many = _many(n, m, nu, threading.get_ident())
    cases = [({"d": d, "P": P}, {**along, "Q": Q, "r": r}) for (d, P), (Q, r) in zip(starts, noises, strict=True)]
    if isinstance(many, TapeRecursion):
        with suppress(CompileError):  # without the library for several they are run one by one
            return many.side_by_side([{**carried, **each} for carried, each in cases], "log_likelihood")[:, :, 0]
    return np.array([many(carried, each)["log_likelihood"][:, 0] for carried, each in cases])
