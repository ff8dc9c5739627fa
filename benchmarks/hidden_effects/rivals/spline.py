"""Spline only: a free curve for each site and driver; the one with the least error on the confirm block, unnamed."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.interpolate import BSpline

from benchmarks.hidden_effects.cell.simulate import Array
from benchmarks.hidden_effects.rivals.base import Mask, Prepared, adapt, least_squares

BASIS = 6  # cubic functions a curve
BETTER = 0.95  # error on the confirm block, as a share of the base's, from which a curve is taken


def basis(x: Array) -> Array:
    """Cubic B-splines over the range of x, (rows, BASIS); they sum to 1."""
    low, high = float(x.min()), float(x.max())
    inner = np.quantile(x, np.linspace(0.0, 1.0, BASIS - 2))[1:-1]
    inner = np.unique(np.clip(inner, low + 1e-6 * (high - low), high - 1e-6 * (high - low)))
    knots = np.concatenate([[low] * 4, inner, [high] * 4])
    return np.asarray(BSpline.design_matrix(np.clip(x, low, high), knots, 3).todense(), dtype=np.float64)


def judge(p: Prepared) -> dict[str, Any]:
    """Verdict: `unnamed` or `none`."""
    fit, confirm = p.block("fit"), p.block("confirm")
    base = adapt(p)
    best, least, explained = None, BETTER * _rms(p.residual - base, confirm), base
    curves = {"time": basis(np.minimum(p.time, 0.6 * p.seconds)), **{name: basis(z) for name, z in p.drivers.items()}}
    for site, response in p.responses.items():
        for driver, functions in curves.items():
            columns = np.column_stack([p.slopes, response[:, None] * np.tile(functions, (len(p.outputs), 1))])
            try:
                trial = columns @ least_squares(columns, p.residual, fit)
            except np.linalg.LinAlgError:
                continue
            error = _rms(p.residual - trial, confirm)
            if error < least:
                best, least, explained = (site, driver), error, trial
    effects = [{"site": best[0], "driver": best[1], "form": "spline"}] if best else []
    return {"verdict": "unnamed" if best else "none", "effects": effects, "error": p.error(explained)}


def _rms(x: Array, rows: Mask) -> float:
    return float(np.sqrt(np.mean(x[rows] ** 2)))
