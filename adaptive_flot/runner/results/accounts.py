"""How the inputs of a run were decided."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd


def control_account(table: pd.DataFrame) -> dict[str, Any]:
    """How the inputs of a run were decided.

    Parameters
    ----------
    table
        Time series of a run (see `TimeSeries.table`), the rows to account for.

    Returns
    -------
    dict
        `solves` (optimisations), `solve_median_s` and `solve_p99_s` (their wall-clock time [s], NaN without any),
        `status_counts` (decisions by status: every optimisation, and every other interval whose status is not ok) and
        `decided_by` (intervals by who decided).
    """
    solve = table["solve_seconds"] if "solve_seconds" in table else pd.Series(np.nan, table.index)
    status = table["control_status"]
    solved = solve.dropna().to_numpy(dtype=float)
    middle, slow = np.quantile(solved, [0.5, 0.99]) if solved.size else (np.nan, np.nan)
    return {
        "solves": int(solved.size),
        "solve_median_s": float(middle),
        "solve_p99_s": float(slow),
        "status_counts": {str(k): int(n) for k, n in status[solve.notna() | (status != "ok")].value_counts().items()},
        "decided_by": {str(k): int(n) for k, n in table["decided_by"].value_counts().items()},
    }
