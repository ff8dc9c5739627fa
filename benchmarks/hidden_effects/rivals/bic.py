"""Forward selection by the Bayesian information criterion of white noise; n and C always in."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.hidden_effects.cell.simulate import Array
from benchmarks.hidden_effects.rivals.base import Mask, Prepared, least_squares

MOST_TERMS = 6


def judge(p: Prepared) -> dict[str, Any]:
    """Verdict: `named` with every term that was accepted, or `none`."""
    rows = p.block("fit")
    terms, names = p.candidates()
    A = terms[rows]
    total = np.einsum("ij,ij->j", A, A)
    y, count = p.residual[rows], int(rows.sum())
    chosen: list[int] = []
    columns = p.slopes
    score = _bic(columns, p.residual, rows)
    while len(chosen) < MOST_TERMS:
        Q, _ = np.linalg.qr(columns[rows])
        rest = y - Q @ (Q.T @ y)
        left = A - Q @ (Q.T @ A)
        power = np.einsum("ij,ij->j", left, left)
        gain = np.where(power > 1e-6 * total, (left.T @ rest) ** 2 / np.maximum(power, 1e-30), 0.0)
        gain[chosen] = 0.0
        best = int(np.argmax(gain))
        trial = np.column_stack([columns, terms[:, best]])
        new = _bic(trial, p.residual, rows)
        if new >= score:
            break
        columns, score = trial, new
        chosen.append(best)
    error = p.error(columns @ least_squares(columns, p.residual, rows))
    pairs = list(dict.fromkeys(names[k] for k in chosen))
    effects = [{"site": site, "driver": driver, "form": "linear"} for site, driver in pairs]
    verdict = "named" if effects else "none"
    return {"verdict": verdict, "effects": effects, "error": error, "tests": {"bic": score, "samples": count}}


def _bic(columns: Array, y: Array, rows: Mask) -> float:
    """N ln(RSS / N) + k ln N."""
    rest = (y - columns @ least_squares(columns, y, rows))[rows]
    return float(len(rest) * np.log(np.mean(rest**2)) + columns.shape[1] * np.log(len(rest)))
