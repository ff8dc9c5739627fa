"""How well the models in use predicted: one sampling interval ahead, and one move of the controller ahead."""

from __future__ import annotations

import numpy as np
import pandas as pd

from adaptive_flot.greybox.model import FloatArray


def one_step_errors(table: pd.DataFrame, column: str) -> FloatArray:
    """Predicted minus true output at each row of a run's table (N,), before the row's measurement was used."""
    error: FloatArray = (table[f"{column}_predicted"] - table[f"{column}_true"]).to_numpy(dtype=float)
    return error


def one_move_errors(table: pd.DataFrame, plans: pd.DataFrame) -> pd.DataFrame:
    """Grade at the end of the first move of each plan minus the true one then.

    The first move is the one that was applied. So the error comes from the controller's model, from its correction of
    the model, and from disturbances within the move.

    Parameters
    ----------
    table, plans
        Of one run; see `TimeSeries.table` and `plan_table`.

    Returns
    -------
    DataFrame
        `time_s` and `error`, one row a plan whose first move ends within the table; empty without plans.
    """
    if plans.empty:
        return pd.DataFrame({"time_s": [], "error": []})
    first = plans.groupby("planned_at_s", as_index=False).first()
    time = table["time_s"].to_numpy(dtype=float)
    first = first[first["time_s"].between(time[0], time[-1])]
    true = np.interp(first["time_s"], time, table["concentrate_grade_true"])
    return pd.DataFrame({"time_s": first["time_s"].to_numpy(), "error": first["concentrate_grade"].to_numpy() - true})


def rms(values: FloatArray) -> float:
    """Root mean square of the finite values; NaN where there is none."""
    seen = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(seen**2))) if seen.size else float("nan")
