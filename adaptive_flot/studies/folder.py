"""The folder of a study: which runs it holds, what was asked of it, and how a part is added or merged without loss.

==================== =========================================================================================
`study.json`         the grid: cases with their hashes, seeds, options
`parts/*.parquet`    results as they come in: `<number>-runs.parquet` and, apart, what depends on the machine and the
                     hour, `<number>-timings.parquet`; both carry the column `run`
`runs.parquet`       all results in the order of the grid, once the study is complete: the same bytes whatever the
                     number of workers and interruptions
`timings.parquet`    times of the runs
==================== =========================================================================================

Every file is written whole under another name and then renamed. Files are merged before the merged ones go, so a kill
at any moment leaves each run at least once; readers take the first row of each run.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow
import pyarrow.parquet

from adaptive_flot.errors import OutputError, StudyError
from adaptive_flot.greybox.data.tables import write_table

RUNS, TIMINGS = "runs", "timings"
MOST_PARTS = 200
"""Parts of a kind before they are merged into one."""
COUNTS = ("status_", "control_", "decided_", "fault_")
"""Columns that count; a run without such a status has none of it."""
TEXTS = ("run", "scenario", "controller", "estimator", "outcome", "message", "conditions")
"""Columns of text; all others but the seed are numbers."""


class StudyFolder:
    """Results of one study on disk; made by `locked`, by one sweep at a time.

    Parameters
    ----------
    path
        The folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.parts = path / "parts"
        self._numbers = iter(range(1 + max((_number(f) for f in self.parts.glob("*.parquet")), default=0), 10**9))

    def done(self) -> set[str]:
        """Names of the runs that are there."""
        columns = (pyarrow.parquet.read_table(f, columns=["run"])["run"].to_pylist() for f in self._files(RUNS))
        return {name for column in columns for name in column}

    def add(self, rows: Sequence[Mapping[str, Any]], timings: Sequence[Mapping[str, Any]]) -> None:
        """Write results as one more part."""
        number = next(self._numbers)
        # times first: a kill in between leaves times of a run that is run again, not a run without times
        write_table(pd.DataFrame(timings), self._part(number, TIMINGS))
        write_table(tidy(pd.DataFrame(rows)), self._part(number, RUNS))
        if number % MOST_PARTS == 0:
            self.merge()

    def table(self, kind: str = RUNS) -> pd.DataFrame:
        """All rows so far, each run once."""
        return _read(self._files(kind), kind)

    def merge(self) -> None:
        """Make one part of all parts of a kind."""
        for kind in (TIMINGS, RUNS):
            merged = sorted(self.parts.glob(f"*-{kind}.parquet"))
            if len(merged) > 1:
                self._replace(merged, self._part(next(self._numbers), kind), _read(merged, kind))

    def complete(self, order: Sequence[str]) -> None:
        """Write `runs.parquet` and `timings.parquet` in the order of the grid, and remove the parts."""
        for kind in (TIMINGS, RUNS):
            table = self.table(kind).set_index("run").loc[list(order)].reset_index()
            parts = sorted(self.parts.glob(f"*-{kind}.parquet"))
            self._replace(parts, self.path / f"{kind}.parquet", table)
        with suppress(OSError):
            self.parts.rmdir()

    def forget(self, outcome: str) -> int:
        """Remove the runs of an outcome, so that they are run again; returns how many there were."""
        table = self.table()
        kept = table[table["outcome"] != outcome]
        if len(kept) < len(table):
            self._replace(self._files(RUNS), self._part(next(self._numbers), RUNS), kept)
        return len(table) - len(kept)

    def _replace(self, old: Iterable[Path], new: Path, table: pd.DataFrame) -> None:
        write_table(table, new)
        for file in old:
            if file != new:
                file.unlink()

    def _files(self, kind: str) -> list[Path]:
        whole = self.path / f"{kind}.parquet"
        return [*([whole] if whole.is_file() else []), *sorted(self.parts.glob(f"*-{kind}.parquet"))]

    def _part(self, number: int, kind: str) -> Path:
        return self.parts / f"{number:06d}-{kind}.parquet"


@contextmanager
def locked(path: Path) -> Iterator[StudyFolder]:
    """Open a study folder for writing.

    Raises
    ------
    StudyError
        Another sweep writes to it at this moment.
    OutputError
        The folder can not be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        handle = os.open(path / ".lock", os.O_CREAT | os.O_RDWR, 0o644)
    except OSError as error:
        raise OutputError(f"{path}: can not be written ({error.strerror or error}); give another folder") from error
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)  # goes with the process, however that ends
        except OSError as error:
            raise StudyError(f"{path}: another sweep writes to it now; wait for it, or give another --out") from error
        for unfinished in (*path.glob(".adaptive-flot-*"), *path.glob("parts/.adaptive-flot-*")):
            unfinished.unlink()
        yield StudyFolder(path)
    finally:
        os.close(handle)


def tidy(table: pd.DataFrame) -> pd.DataFrame:
    """Columns in a fixed order and type, so that the table depends on its rows only and not on how they came in."""
    columns = sorted(map(str, table.columns))
    texts = [c for c in TEXTS if c in columns]
    counts = [c for c in columns if c.startswith(COUNTS)]
    numbers = [c for c in columns if c not in (*TEXTS, *counts, "seed")]
    types = dict.fromkeys(texts, "str") | dict.fromkeys(numbers, "float64") | dict.fromkeys(counts, "int64")
    filled = table.fillna(dict.fromkeys(counts, 0))
    return filled[[*texts, "seed", *numbers, *counts]].astype({"seed": "int64", **types})


def _read(files: Sequence[Path], kind: str) -> pd.DataFrame:
    if not files:
        return pd.DataFrame({column: pd.Series(dtype="str") for column in ("run", "outcome")})
    table = pd.concat([pd.read_parquet(f) for f in files], ignore_index=True).drop_duplicates("run", ignore_index=True)
    return tidy(table) if kind == RUNS else table


def _number(part: Path) -> int:
    head = part.name.partition("-")[0]
    return int(head) if head.isdigit() else 0
