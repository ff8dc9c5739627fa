"""Command line: `python -m benchmarks.hidden_effects generate|score`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from adaptive_flot.errors import AdaptiveFlotError

app = typer.Typer(help=__doc__, no_args_is_help=True, pretty_exceptions_enable=False, add_completion=False)
Jobs = Annotated[int, typer.Option(min=1, max=64, help="Processes.")]


@app.callback()
def _main() -> None:
    """Records with an effect the cell model lacks, and the score of whoever tries to find it."""


def progress() -> Progress:
    """A bar on standard error."""
    from rich.console import Console

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, console=Console(stderr=True))


@app.command()
def generate(
    out: Annotated[Path, typer.Option(help="Folder of the records; what it holds already is kept.")],
    count: Annotated[int, typer.Option(min=1, help="Number of records.")] = 300,
    seed: Annotated[int, typer.Option(min=0, help="Seed; record k is the same whatever the count.")] = 2026,
    jobs: Jobs = 2,
) -> None:
    """Write records and answers."""
    from benchmarks.hidden_effects.generate import generate as write

    with progress() as bar:
        task = bar.add_task("records", total=count)
        write(out, seed, count, jobs, lambda: bar.advance(task))


try:
    app()
except AdaptiveFlotError as error:
    print(error, file=sys.stderr)
    raise SystemExit(2) from None
