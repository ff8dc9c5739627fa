"""Write the records of a seed to a folder; what is there already is kept, so that an interrupt costs one record.

DIR/manifest.json             seed and version of the generator
DIR/records/record_0000.csv   what a discover command may see
DIR/answers/record_0000.json  what it may not
DIR/answers.json              all answers in one file
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import pandas as pd

from adaptive_flot.errors import DataError
from adaptive_flot.files import replace_file, write_text
from benchmarks.hidden_effects.generate.record import Record, make_record

VERSION = 1  # raise it when the same seed gives other records


def record_file(folder: Path, name: str) -> Path:
    """Table of a record."""
    return folder / "records" / f"{name}.csv"


def answer_file(folder: Path, name: str) -> Path:
    """Answer to a record."""
    return folder / "answers" / f"{name}.json"


def write_record(folder: Path, record: Record) -> None:
    """Write a record's table (seven digits, an empty cell is missing) and its answer."""
    table = record.table.copy()
    time = [f"{t:.1f}" for t in table.pop("time_s")]
    table.insert(0, "time_s", pd.Series(time, dtype=object))
    with replace_file(record_file(folder, record.name)) as stream:
        table.to_csv(stream, index=False, float_format="%.6e", lineterminator="\n")
    write_text(answer_file(folder, record.name), json.dumps(record.answer.as_dict(), indent=1) + "\n")


def generate(folder: Path, seed: int, count: int, jobs: int, advance: Callable[[], None] = lambda: None) -> None:
    """Write records 0 .. count-1 of a seed; calls advance() for each.

    Raises
    ------
    DataError
        The folder holds records of another seed or version.
    """
    _claim(folder, seed)
    missing = [k for k in range(count) if not answer_file(folder, f"record_{k:04d}").is_file()]
    for _ in range(count - len(missing)):
        advance()
    for _ in _made(folder, seed, missing, jobs):
        advance()
    collect(folder)


def _made(folder: Path, seed: int, missing: list[int], jobs: int) -> Iterable[int]:
    if jobs == 1:
        for k in missing:
            yield _make_one(folder, seed, k)
        return
    with ProcessPoolExecutor(jobs) as pool:
        for future in as_completed([pool.submit(_make_one, folder, seed, k) for k in missing]):
            yield future.result()


def _make_one(folder: Path, seed: int, k: int) -> int:
    write_record(folder, make_record(seed, k))
    return k


def _claim(folder: Path, seed: int) -> None:
    """Write the manifest, or check that the one there is ours."""
    manifest, wanted = folder / "manifest.json", {"seed": seed, "version": VERSION}
    if manifest.is_file():
        present = json.loads(manifest.read_text())
        if present != wanted:
            raise DataError(f"{manifest}: holds records of {present}, not of {wanted}; give another folder")
        return
    write_text(manifest, json.dumps(wanted) + "\n")


def collect(folder: Path) -> dict[str, dict[str, Any]]:
    """Gather the answers of a folder into `answers.json`."""
    answers = load_answers(folder)
    write_text(folder / "answers.json", json.dumps(answers, indent=1) + "\n")
    return answers


def load_answers(folder: Path, count: int | None = None) -> dict[str, dict[str, Any]]:
    """Answers of a folder (of its first records) by record name.

    Raises
    ------
    DataError
        There are none.
    """
    files = sorted((folder / "answers").glob("record_*.json"))[:count]
    if not files:
        raise DataError(
            f"{folder}: no answers/record_*.json; make some with `python -m benchmarks.hidden_effects generate`"
        )
    return {file.stem: json.loads(file.read_text()) for file in files}
