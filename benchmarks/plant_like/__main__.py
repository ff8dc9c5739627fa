"""Command line: `python -m benchmarks.plant_like generate|score|limit`."""

from __future__ import annotations

import json
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from adaptive_flot.files import replace_file, write_text
from benchmarks.hidden_effects.__main__ import progress
from benchmarks.hidden_effects.score.commands import run_command
from benchmarks.hidden_effects.score.figures import discover_command
from benchmarks.plant_like.limit import limit_of, summary
from benchmarks.plant_like.record import make_record
from benchmarks.plant_like.score import figures, results
from benchmarks.plant_like.sizes import size_words, sizes

app = typer.Typer(help=__doc__, no_args_is_help=True, pretty_exceptions_enable=False, add_completion=False)
Jobs = Annotated[int, typer.Option(min=1, max=64, help="Processes.")]
Count = Annotated[int, typer.Option(min=1, help="Number of records.")]


@app.callback()
def _main() -> None:
    """Plant-like records, and the score of whoever tries to find what is missing."""


def _make(job: tuple[Path, int, int]) -> None:
    folder, seed, k = job
    made = make_record(seed, k)
    with replace_file(folder / "records" / f"record_{k:04d}.csv") as stream:
        made.table.to_csv(stream, index=False, float_format="%.6e", lineterminator="\n")
    write_text(folder / "answers" / f"record_{k:04d}.json", json.dumps(made.answer, indent=1) + "\n")


def make_missing(make: Callable[[tuple[Path, int, int]], None], out: Path, seed: int, count: int, jobs: int) -> None:
    """Make the records 0 to count - 1 of a seed that a folder does not hold yet; `make` takes (folder, seed, k)."""
    todo = [(out, seed, k) for k in range(count) if not (out / "answers" / f"record_{k:04d}.json").is_file()]
    with progress() as bar, ProcessPoolExecutor(jobs) as pool:
        task = bar.add_task("records", total=len(todo))
        for _ in pool.map(make, todo):
            bar.advance(task)


def _records(folder: Path) -> list[str]:
    """Names of the records that a folder has answers of.

    Raises
    ------
    typer.BadParameter
        There are none.
    """
    names = sorted(f.stem for f in (folder / "answers").glob("*.json"))
    if not names:
        raise typer.BadParameter(f"{folder}: no answers; make some with `python -m benchmarks.plant_like generate`")
    return names


@app.command()
def generate(
    out: Annotated[Path, typer.Option(help="Folder of the records; what it holds already is kept.")],
    count: Count = 100,
    seed: Annotated[int, typer.Option(min=0, help="Seed; record k is the same whatever the count.")] = 2027,
    jobs: Jobs = 2,
) -> None:
    """Write records and answers."""
    make_missing(_make, out, seed, count, jobs)


@app.command()
def score(
    folder: Annotated[Path, typer.Argument(help="Folder of the records.")],
    label: Annotated[str, typer.Option(help="Name of the run.")] = "discover",
    command: Annotated[str | None, typer.Option(help="Command template with {record} and {json}.")] = None,
    jobs: Jobs = 2,
    timeout: Annotated[float, typer.Option(min=1.0, help="Seconds for a record.")] = 300.0,
    count: Annotated[int | None, typer.Option(min=1, help="Only the first records.")] = None,
) -> None:
    """Judge every record and print how often the verdict is right; what is judged already is kept."""
    total = count or len(_records(folder))
    with progress() as bar:
        task = bar.add_task(label, total=total)
        run_command(folder, label, command or discover_command(), jobs, timeout, lambda: bar.advance(task), count)
    table = results(folder, label)
    with replace_file(folder / "runs" / label / "results.csv") as stream:
        table.to_csv(stream, index=False, lineterminator="\n")
    print(table.to_string(index=False))
    print(figures(table).to_string(index=False))
    print(size_words(sizes(folder, label)))


@app.command()
def limit(
    folder: Annotated[Path, typer.Argument(help="Folder of the records.")],
    jobs: Jobs = 2,
) -> None:
    """Give each record its effect, and print whether it gains enough over the background alone to be told."""
    names = _records(folder)
    rows = []
    with progress() as bar, ProcessPoolExecutor(jobs) as pool:
        task = bar.add_task("limit", total=len(names))
        for row in pool.map(limit_of, [(folder, name) for name in names]):
            rows += [row] if row else []
            bar.advance(task)
    table = pd.DataFrame(rows)
    with replace_file(folder / "limit.csv") as stream:
        table.to_csv(stream, index=False, lineterminator="\n")
    print(table.to_string(index=False))
    print(summary(table))


if __name__ == "__main__":
    app()
