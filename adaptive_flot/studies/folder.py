"""The folder of a study: which runs it holds, what was asked of it, and how a part is added or merged without loss.

==================== =========================================================================================
`study.json`         the grid: cases with their hashes, seeds, options
`parts/*.parquet`    results as they come in, `<number>-runs.parquet`, and times, `<number>-timings.parquet`
`runs.parquet`       all results in the order of the grid, once the study is complete
`timings.parquet`    times of the runs
==================== =========================================================================================

Both kinds of parts carry the column `run`. What depends on the machine and the hour is in the timings only, so
`runs.parquet` has the same bytes whatever the number of workers and interruptions.

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
NEEDED = ("run", "scenario", "controller", "estimator", "seed", "outcome", "message")
"""Columns that every table of runs has."""
TEXTS = ("run", "scenario", "controller", "estimator", "outcome", "message", "conditions", "options")
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
            rows, wanted = self.table(kind).set_index("run"), list(order)
            # times may be gone with a damaged part that was removed, and no result depends on them
            table = (rows.loc[wanted] if kind == RUNS else rows.reindex(wanted)).reset_index()
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
    lock = path / ".lock"
    made = [folder for folder in (path, *path.parents) if not folder.exists()]
    try:
        path.mkdir(parents=True, exist_ok=True)
        handle = os.open(lock, os.O_CREAT | os.O_RDWR, 0o644)
    except OSError as error:
        raise OutputError(f"{path}: can not be written ({error.strerror or error}); give another folder") from error
    try:
        _take(handle, lock)
        for unfinished in (*path.glob(".adaptive-flot-*"), *path.glob("parts/.adaptive-flot-*")):
            unfinished.unlink()
        try:
            yield StudyFolder(path)
        finally:
            lock.unlink(missing_ok=True)
            with suppress(OSError):  # a study that was refused leaves no empty folder behind
                for empty in made:
                    empty.rmdir()
    finally:
        os.close(handle)


def _take(handle: int, lock: Path) -> None:
    """Lock an open file; the lock goes with the process, however that ends."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if not os.path.samestat(os.fstat(handle), lock.stat()):
            raise OSError("removed by the sweep that held it")
    except OSError as error:
        raise StudyError(
            f"{lock.parent}: another sweep writes to it now; wait for it, or give another --out"
        ) from error


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
    tables = [_checked(file, kind) for file in files]
    table = pd.concat(tables, ignore_index=True).drop_duplicates("run", ignore_index=True)
    return tidy(table) if kind == RUNS else table


def _checked(file: Path, kind: str) -> pd.DataFrame:
    """Content of a part.

    Raises
    ------
    StudyError
        It is damaged, or another table.
    """
    way_out = "remove it, and the runs in it are made again"
    try:
        table = pd.read_parquet(file)
    except (OSError, ValueError, pyarrow.ArrowException) as error:
        reason = " ".join(str(error).split())
        raise StudyError(f"{file}: damaged, no Parquet file can be read ({reason}); {way_out}") from error
    missing = [c for c in (NEEDED if kind == RUNS else ("run",)) if c not in table]
    if missing:
        raise StudyError(f"{file}: not a table of {kind} (no column {missing[0]!r}); {way_out}")
    try:
        if kind == RUNS:
            tidy(table)
    except (ValueError, TypeError) as error:
        raise StudyError(f"{file}: damaged, a column has the wrong type ({error}); {way_out}") from error
    return table


def _number(part: Path) -> int:
    head = part.name.partition("-")[0]
    return int(head) if head.isdigit() else 0
