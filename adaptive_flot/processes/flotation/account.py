"""What a run of a flotation cell earned: recovery, grade and its limit, value by term."""

from __future__ import annotations

import numpy as np
import pandas as pd

from adaptive_flot.greybox.model import Model
from adaptive_flot.processes.flotation.economics import Prices, valuable_feed, value_rates

TOLERATED_DEPTH = 0.002
"""Depth below the grade limit from which a sample counts as a violation."""


def account(table: pd.DataFrame, model: Model, dt: float, prices: Prices, grade_limit: float) -> dict[str, float]:
    """Account of the rows of a run, from the plant's true outputs.

    Parameters
    ----------
    table
        Time series of a run (see `TimeSeries.table`), the rows to account for.
    model
        The nominal model: feed concentration of the valuable mineral [kg/m3], where the table does not hold its own.
    dt
        Sampling interval [s].
    prices
        Prices [cu].
    grade_limit
        Lowest grade allowed [-].

    Returns
    -------
    dict
        `recovery` (valuable mass recovered / fed), `mean_grade` (by mass of concentrate), `below_limit` (share of time
        more than 0.002 below the limit), `mean_depth` (mean depth below the limit in that time), `value_cu_h` (economic
        value an hour) and each of its terms `value_<term>_cu_h`.
    """
    valuable = valuable_feed(model)
    moved = f"{valuable.label}_true"
    concentration = table[moved].to_numpy(dtype=float) if moved in table else np.full(len(table), valuable.value)
    grade, recovery = (table[c].to_numpy(dtype=float) for c in ("concentrate_grade_true", "recovery_true"))
    air, feed = (
        table[f"{c}_true" if f"{c}_true" in table else c].to_numpy(dtype=float)
        for c in ("air_flow_m3_s", "feed_flow_m3_s")
    )
    fed = float(np.sum(concentration * feed) * dt)
    recovered = float(np.sum(recovery * concentration * feed) * dt)
    concentrate = float(np.sum(recovery * concentration * feed / grade) * dt)
    depth = grade_limit - grade
    below = depth > TOLERATED_DEPTH
    rates = value_rates(grade, recovery, air, feed, concentration, prices.prices())
    terms = {f"value_{name}_cu_h": float(3600 * np.mean(rate)) for name, rate in rates.items()}
    return {
        "recovery": recovered / fed,
        "mean_grade": recovered / concentrate,
        "below_limit": float(np.mean(below)),
        "mean_depth": float(np.mean(depth[below])) if below.any() else 0.0,
        "value_cu_h": sum(terms.values()),
        **terms,
    }
