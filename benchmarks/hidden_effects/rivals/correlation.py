"""Plain correlation: the candidate that correlates most with the residual, if Student's t at 5 % (Bonferroni) says so.

Neither are n and C projected out nor is the noise whitened: what many would do first.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.stats import t as student

from benchmarks.hidden_effects.rivals.base import Prepared


def judge(p: Prepared) -> dict[str, Any]:
    """Verdict: `named` or `none`."""
    rows = p.block("fit")
    columns, names = p.candidates()
    y, A = p.residual[rows], columns[rows]
    norms = np.linalg.norm(A, axis=0) * np.linalg.norm(y)
    r = np.divide(A.T @ y, norms, out=np.zeros(A.shape[1]), where=norms > 0.0)
    best = int(np.argmax(np.abs(r)))
    count = len(y)
    statistic = abs(r[best]) * np.sqrt((count - 2) / max(1e-12, 1.0 - r[best] ** 2))
    chance = min(1.0, 2.0 * float(student.sf(statistic, count - 2)) * len(names))
    if chance > 0.05:
        return {"verdict": "none", "error": p.error(0.0 * p.residual)}
    column = columns[:, best]
    amplitude = float(column[rows] @ y) / float(column[rows] @ column[rows])
    site, driver = names[best]
    return {
        "verdict": "named",
        "effects": [{"site": site, "driver": driver, "form": "linear", "parameters": {"amplitude": amplitude}}],
        "error": p.error(amplitude * column),
    }
