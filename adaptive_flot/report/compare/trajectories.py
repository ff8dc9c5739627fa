"""Time series of the contenders over each other, from the files beside their results."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from adaptive_flot.charts.plotdata import Chart, Panel, Role, Trace
from adaptive_flot.errors import AdaptiveFlotError
from adaptive_flot.greybox.data.tables import read_table
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.report.compare.contenders import roles
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.parts import Picture
from adaptive_flot.report.kit.wording import spaced
from adaptive_flot.runner.commands.comparison import ORACLE, Comparison, Contender
from adaptive_flot.runner.commands.runs.run_files import time_series_file

OPERATION = ("concentrate_grade", "recovery")


def trajectories_picture(comparison: Comparison, album: Album) -> Picture | None:
    """Grade and recovery of each contender; without economics the errors of the estimates. None without time series.

    One seed is shown, the first that all contenders ran.
    """
    seeds = set.intersection(*(set(c.seeds) for c in comparison.contenders))
    if not seeds:
        return None
    seed = min(seeds)
    tables = {c.label: table for c in comparison.contenders if (table := _table(c, seed)) is not None}
    if not tables:
        return None
    earned = np.isfinite(comparison.grade_limit)
    panels = _operation(comparison, tables) if earned else _errors(comparison, tables)
    if not panels:
        return None
    what = "true grade and recovery of the plant; dashed: the lowest grade allowed" if earned else "errors of estimates"
    caption = f"{comparison.scenario}: {what}, each contender over the others. Seed {seed}."
    return album.chart(Chart(tuple(panels)), caption, f"Trajectories of all contenders over time: {what}")


def _table(c: Contender, seed: int) -> pd.DataFrame | None:
    """Time series of a run; None where the result keeps none, as that of a study, or it can not be read."""
    if "result" not in c.runs:
        return None
    place = Path(str(c.runs.loc[seed, "result"]))
    file = time_series_file(place if place.is_dir() else place.parent, c.estimator, c.controller, seed)
    if file is None:
        return None
    try:
        return read_table(file)
    except AdaptiveFlotError:
        return None


def _operation(comparison: Comparison, tables: dict[str, pd.DataFrame]) -> list[Panel]:
    looks = {
        label: (Role.KNOWING if role is Role.TRUTH else role, slot) for label, (role, slot) in roles(comparison).items()
    }
    panels = []
    for name in OPERATION:
        column = f"{name}_true"
        traces = tuple(
            Trace(label, table["time_s"].to_numpy(dtype=float), table[column].to_numpy(dtype=float), *looks[label])
            for label, table in tables.items()
            if {"time_s", column} <= set(table)
        )
        limits = (comparison.grade_limit,) if name == "concentrate_grade" else ()
        if traces:
            panels.append(Panel(spaced(name), "-", traces, height=1.2, limits=limits))
    return panels


def _errors(comparison: Comparison, tables: dict[str, pd.DataFrame]) -> list[Panel]:
    """Errors of adapted parameters and of predicted driving outputs in percent of the truth."""
    looks = roles(comparison)
    estimators = {c.label: c.estimator for c in comparison.contenders}
    pairs = dict.fromkeys(
        (column, f"{name}_true", name)
        for table in tables.values()
        for column in map(str, table.columns)
        for end in ("_estimate", "_predicted")
        if column.endswith(end) and _driving(table, name := column.removesuffix(end), end)
    )
    panels = []
    for column, true, name in pairs:
        traces = tuple(
            _error_trace(label, table[table[column].notna()], column, true, looks[label])
            for label, table in tables.items()
            if {"time_s", column, true} <= set(table) and estimators[label] != ORACLE
        )
        if traces:
            panels.append(Panel(f"error of {spaced(name)}", "%", traces, zoom=True))
    return panels


def _error_trace(label: str, table: pd.DataFrame, column: str, true: str, look: tuple[Role, int]) -> Trace:
    return Trace(label, table["time_s"].to_numpy(dtype=float), _percent(table[column], table[true]), *look)


def _driving(table: pd.DataFrame, name: str, end: str) -> bool:
    return f"{name}_true" in table and (end == "_estimate" or f"{name}_innovation_std" in table)


def _percent(estimate: pd.Series[float], true: pd.Series[float]) -> FloatArray:
    truth = true.to_numpy(dtype=float)
    error: FloatArray = 100 * (estimate.to_numpy(dtype=float) - truth) / np.mean(np.abs(truth))
    return error
