"""Estimate drift only: n and C as random walks (Kalman filter and smoother), then regressed on each driver.

The first half of stochastic grey-box improvement (Kristensen, Madsen & Jorgensen 2004) and nothing more: it can say
coalescence or growth exponent, and by which driver.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.hidden_effects.cell.simulate import Array
from benchmarks.hidden_effects.generate.nominal_fit import REACH
from benchmarks.hidden_effects.rivals.base import Fitted

WALK = np.array([2e-3, 8e-3])  # standard deviation of ln n and ln C a row (5 s)
EXPLAINED = 0.3  # share of the smoothed estimate's variance that a driver must explain
MOVED = 3.0  # standard deviations of the smoothed estimate by which it must move


def smooth(p: Fitted) -> tuple[Array, Array]:
    """Smoothed shifts of (ln n, ln C), (rows, 2), and their standard deviations."""
    rows, outputs = len(p.time), len(p.outputs)
    H = p.slopes.reshape(outputs, rows, 2)
    y = p.residual.reshape(outputs, rows)
    x, P, Q = np.zeros(2), np.diag([0.02, 0.2]) ** 2, np.diag(WALK**2)
    filtered, covariances, predicted = [], [], []
    for k in range(rows):
        P = P + Q
        predicted.append(P)
        seen = np.isfinite(y[:, k])
        h = H[seen, k]
        S = h @ P @ h.T + np.eye(int(seen.sum()))
        K = np.linalg.solve(S, h @ P).T
        x = x + K @ (y[seen, k] - h @ x)
        P = (np.eye(2) - K @ h) @ P
        filtered.append(x)
        covariances.append(P)
    states, spread = np.array(filtered), np.array(covariances)
    for k in range(rows - 2, -1, -1):
        G = spread[k] @ np.linalg.inv(predicted[k + 1])
        states[k] = states[k] + G @ (states[k + 1] - states[k])
        spread[k] = spread[k] + G @ (spread[k + 1] - predicted[k + 1]) @ G.T
    return states, np.sqrt(np.abs(np.diagonal(spread, axis1=1, axis2=2)))


def judge(p: Fitted) -> dict[str, Any]:
    """Verdict: `named` (one of the two parameters and a driver) or `none`."""
    states, spread = smooth(p)
    part = p.time <= 0.6 * p.time[-1]
    moved = states[part].std(axis=0) / spread[part].mean(axis=0)
    which = int(np.argmax(moved))
    nothing = {"verdict": "none", "error": p.error(0.0 * p.residual)}
    if moved[which] < MOVED:
        return nothing
    x = states[:, which]
    time = {"time": (p.time - p.time.mean()) / p.time.std()}
    fits = {name: _line(z, x, part) for name, z in {**time, **p.drivers}.items()}
    driver = max(fits, key=lambda name: fits[name][1])
    line, explained = fits[driver]
    line = np.clip(line, -REACH[which], REACH[which])
    if explained < EXPLAINED:
        return nothing
    shift = np.tile(line, len(p.outputs)) * p.slopes[:, which]
    site = ("growth_exponent", "coalescence")[which]
    return {
        "verdict": "named",
        "effects": [{"site": site, "driver": driver, "form": "linear"}],
        "error": p.error(shift),
        "tests": {"explained": explained},
    }


def _line(z: Array, x: Array, part: Array) -> tuple[Array, float]:
    """Straight line of x over z fitted on part of the rows, and its share of the variance there."""
    slope, offset = np.polyfit(z[part], x[part], 1)
    line = offset + slope * z
    return line, 1.0 - float(np.var(x[part] - line[part]) / np.var(x[part]))
