"""The table of runs, one row a run: what `compare` reads, from the summary of `run` or the Parquet parts of a study."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow
import pyarrow.parquet

from adaptive_flot.errors import ResultError

KEYS = ("scenario", "controller", "estimator", "seed")
"""Columns that name a run; every table of runs has them."""
SUMMARY = "summary.json"
WORDS = ("run", "outcome", "message", "conditions", "code", "options")
"""Further columns of words; all others are numbers."""
TIMINGS = "timings"
"""End of the names of the files in which a study keeps times."""


def run_rows(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Rows of the runs in a summary as `run_summary` makes it.

    Parameters
    ----------
    summary
        Summary of one scenario; read back from JSON or not.

    Returns
    -------
    list of dict
        For each run `scenario`, `controller`, `estimator`, `seed`, `seconds`, `fit_<quantity>` [%] and
        `status_<name>` (samples by status of the estimator), `code` and `options` that made it; where the scenario
        has economics also `conditions`, `grade_limit`, the entries of `account`, `solves`, `solve_median_s`,
        `solve_p99_s`, `control_<status>` (decisions by status), `decided_<who>` (intervals by who decided) and
        `fault_<name>` (intervals it changed).

    Raises
    ------
    ResultError
        The summary lacks a key.
    """
    head = {key: summary[key] for key in ("conditions", "grade_limit", "code") if key in summary}
    rows = []
    for run in summary["runs"]:
        row: dict[str, Any] = {"scenario": summary["scenario"], **{key: run[key] for key in KEYS[1:]}, **head}
        row["seconds"] = run.get("seconds")
        if "options" in run:
            row["options"] = _text(run["options"])
        control = run.get("control", {})
        row |= {f"fit_{key}": value for key, value in run.get("fit", {}).items()} | run.get("account", {})
        row |= {key: control[key] for key in ("solves", "solve_median_s", "solve_p99_s") if key in control}
        for prefix, counts in (
            ("status", run.get("status_counts", {})),
            ("control", control.get("status_counts", {})),
            ("decided", control.get("decided_by", {})),
            ("fault", run.get("fault_counts", {})),
        ):
            row |= {f"{prefix}_{key}": count for key, count in counts.items()}
        rows.append(row)
    return rows


def _text(options: Mapping[str, Mapping[str, str]]) -> str:
    """Options of a run in words: "controller: horizon 3; estimator: forgetting 0.995"."""
    parts = (f"{who}: {', '.join(f'{k} {v}' for k, v in given.items())}" for who, given in sorted(options.items()))
    return "; ".join(parts)


def read_runs(results: Sequence[Path]) -> pd.DataFrame:
    """Table of the runs of several results.

    Parameters
    ----------
    results
        Each a folder that `run` wrote, a folder with Parquet parts of a study, a summary (JSON) or a table of runs
        (Parquet).

    Returns
    -------
    DataFrame
        One row a run; see `run_rows`, and `result`: the path as it was given.

    Raises
    ------
    ResultError
        No such file or folder, no results in it, a result given twice, results of two scenarios of the same name.
    """
    seen: dict[Path, Path] = {}
    tables = []
    for path in results:
        place = _file_or_folder(path)
        if place in seen:
            raise ResultError(f"{path}: the same result as {seen[place]}; give each once")
        seen[place] = path
        table = _read(place, path)
        _check_columns(table, path)
        tables.append(table.assign(result=str(path)))
    table = pd.concat(tables, ignore_index=True)
    if table.empty:
        raise ResultError(f"{', '.join(map(str, results))}: no run has finished; run it first")
    _check_conditions(table)
    return table


def result_files(results: Sequence[Path]) -> list[Path]:
    """Files that `read_runs` may read of these results."""
    inside = ([*p.rglob("*.parquet"), p / SUMMARY] if p.is_dir() else [p] for p in results)
    return [file for files in inside for file in files]


def _file_or_folder(path: Path) -> Path:
    """Where the runs are: a summary, a Parquet file, or a folder of parts."""
    if not path.exists():
        raise ResultError(f"{path}: no such file or folder; give what `adaptive-flot run` wrote, as results/NAME/run")
    return (path / SUMMARY if path.is_dir() and (path / SUMMARY).is_file() else path).resolve()


def _read(place: Path, path: Path) -> pd.DataFrame:
    if place.is_dir():
        return _read_parts(place, path)
    if place.suffix == ".parquet":
        if not _is_table_of_runs(place):
            raise ResultError(f"{path}: not a table of runs (no columns {', '.join(KEYS)}); give the folder it lies in")
        return _read_parquet(place)
    return _read_summary(place, path)


def _read_summary(file: Path, path: Path) -> pd.DataFrame:
    if file.suffix != ".json":
        raise ResultError(f"{path}: neither a folder nor a summary (.json, .parquet); give the folder that `run` wrote")
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ResultError(f"{path}: not a JSON summary ({error}); give what `adaptive-flot run` wrote") from error
    summaries = content if isinstance(content, list) else [content]
    if any(isinstance(s, dict) and "estimators" in s and "fit" in s for s in summaries):
        raise ResultError(f"{path}: a result of `estimate`; `compare` takes results of `run`")
    try:
        return pd.DataFrame([row for summary in summaries for row in run_rows(summary)])
    except (KeyError, TypeError, AttributeError) as error:
        lacks = f"no {error.args[0]!r} in it" if isinstance(error, KeyError) else "its entries are of another kind"
        raise ResultError(f"{path}: not a summary of runs ({lacks}); give what `adaptive-flot run` wrote") from error


def _read_parts(folder: Path, path: Path) -> pd.DataFrame:
    parts = [f for f in sorted(folder.rglob("*.parquet")) if not f.name.startswith(".") and _is_table_of_runs(f)]
    if not parts:
        inside = sorted(f.parent.name for f in folder.glob(f"*/{SUMMARY}"))
        hint = f"its folders {', '.join(inside)} have: give those" if inside else "give what `adaptive-flot run` wrote"
        raise ResultError(f"{path}: no results in this folder (no {SUMMARY}, no Parquet table of runs); {hint}")
    table = pd.concat([_read_parquet(part) for part in parts], ignore_index=True)
    # a study that was killed while it merged its parts holds some runs twice, the same to the bit
    return _with_times(table.drop_duplicates("run", ignore_index=True), folder) if "run" in table else table


def _with_times(table: pd.DataFrame, folder: Path) -> pd.DataFrame:
    """Add what each run of a study took, which lies apart from its results."""
    files = [f for f in sorted(folder.rglob(f"*{TIMINGS}.parquet")) if not f.name.startswith(".")]
    if not files:
        return table
    times = pd.concat([_read_parquet(f, ("run",)) for f in files], ignore_index=True).drop_duplicates("run")
    new = [c for c in times.select_dtypes("number").columns if c not in table]
    return table.merge(times[["run", *new]], on="run", how="left", validate="one_to_one")


def _read_parquet(file: Path, needed: Sequence[str] = KEYS) -> pd.DataFrame:
    try:
        table = pd.read_parquet(file)
    except (OSError, ValueError, pyarrow.ArrowException) as error:
        raise ResultError(f"{file}: damaged, not a Parquet file ({' '.join(str(error).split())}); remove it") from error
    missing = [column for column in needed if column not in table]
    if missing:
        raise ResultError(f"{file}: damaged, no column {missing[0]!r}; remove it")
    return table


def _check_columns(table: pd.DataFrame, path: Path) -> None:
    """Names must be words, seeds whole numbers and all else numbers, or what compares runs would fail later."""
    again = "run it again"
    for name in KEYS[:-1]:
        if name in table and not table[name].map(lambda value: isinstance(value, str) and value != "").all():
            raise ResultError(f"{path}: damaged, a run without a word for its {name}; {again}")
    if "seed" in table and not pd.api.types.is_integer_dtype(table["seed"]):
        raise ResultError(f"{path}: damaged, a seed that is no whole number; {again}")
    for column in (c for c in table.columns if c not in (*KEYS, *WORDS)):
        if not (pd.api.types.is_numeric_dtype(table[column]) or table[column].map(_is_number).all()):
            raise ResultError(f"{path}: damaged, {column!r} of a run is no number; {again}")
    if "conditions" in table and not table["conditions"].map(lambda v: isinstance(v, str) or _is_number(v)).all():
        raise ResultError(f"{path}: damaged, the conditions of a run are no word; {again}")


def _is_number(value: object) -> bool:
    return value is None or isinstance(value, float | int)


def _is_table_of_runs(file: Path) -> bool:
    try:
        return set(KEYS) <= set(pyarrow.parquet.read_schema(file).names)
    except (OSError, pyarrow.ArrowException) as error:
        raise ResultError(f"{file}: not a Parquet file ({' '.join(str(error).split())}); remove it") from error


def _check_conditions(table: pd.DataFrame) -> None:
    """Runs of one scenario name must have been asked the same."""
    if "conditions" not in table:
        return
    for name, rows in table.groupby("scenario", sort=False):
        distinct = rows.drop_duplicates("conditions")
        if len(distinct) > 1:
            a, b = distinct["result"].iloc[0], distinct["result"].iloc[1]
            raise ResultError(
                f"{b}: scenario {name!r} differs from that of {a} (plant, inputs, drift, noise, limits, prices or "
                "accounted time), so the runs do not compare; run both again with one scenario file"
            )
