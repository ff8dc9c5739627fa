"""Command line: `python -m benchmarks.hidden_effects generate|score|table`."""

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
    from benchmarks.hidden_effects.generate.folder import generate as write

    with progress() as bar:
        task = bar.add_task("records", total=count)
        write(out, seed, count, jobs, lambda: bar.advance(task))


@app.command()
def score(
    folder: Annotated[Path, typer.Argument(help="Folder of the records.")],
    command: Annotated[str | None, typer.Option(help="Command template with {record} and {json}.")] = None,
    method: Annotated[str | None, typer.Option(help="A rival of this benchmark, by name.")] = None,
    label: Annotated[str | None, typer.Option(help="Name of the run; default the method or `discover`.")] = None,
    jobs: Jobs = 2,
    timeout: Annotated[float, typer.Option(min=1.0, help="Seconds a command may take for a record.")] = 300.0,
    count: Annotated[int | None, typer.Option(min=1, help="Only the first records.")] = None,
    json: Annotated[Path | None, typer.Option(help="Write the summary here too.")] = None,
) -> None:
    """Run a discover command (default: adaptive-flot discover) on every record and print how often it is right."""
    from benchmarks.hidden_effects.generate.folder import load_answers
    from benchmarks.hidden_effects.score.commands import run_command, run_method
    from benchmarks.hidden_effects.score.figures import discover_command, finish, method_command

    template = method_command(method) if method else (command or discover_command())
    total = len(load_answers(folder, count))
    label = label or method or "discover"
    with progress() as bar:
        task = bar.add_task(label, total=total)
        if method:
            run_method(folder, method, label, template, jobs, lambda: bar.advance(task), count)
        else:
            run_command(folder, label, template, jobs, timeout, lambda: bar.advance(task), count)
    finish(folder, label, json, count)


@app.command()
def full(
    out: Annotated[Path | None, typer.Option(help="Folder; default results/hidden-effects-<seed>.")] = None,
    count: Annotated[int, typer.Option(min=1, help="Number of records.")] = 300,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the records.")] = 2026,
    method: Annotated[list[str] | None, typer.Option(help="Rivals (repeatable); default all.")] = None,
    jobs: Jobs = 2,
    timeout: Annotated[float, typer.Option(min=1.0, help="Seconds a command may take for a record.")] = 300.0,
) -> None:
    """Generate, run the product and its rivals, print all side by side."""
    from benchmarks.hidden_effects.rivals import RIVALS

    folder = out or Path("results") / f"hidden-effects-{seed}"
    generate(folder, count, seed, jobs)
    score(folder, None, None, None, jobs, timeout, count, None)
    for name in method or RIVALS:
        score(folder, None, name, None, jobs, timeout, count, None)
    table(folder, count)


@app.command()
def table(
    folder: Annotated[Path, typer.Argument(help="Folder of the records.")],
    count: Annotated[int | None, typer.Option(min=1, help="Only the first records.")] = None,
) -> None:
    """Print every run on these records side by side."""
    from benchmarks.hidden_effects.score.figures import side_by_side

    side_by_side(folder, count)


@app.command()
def rival(
    name: Annotated[str, typer.Argument(help="Name of the rival.")],
    record: Annotated[Path, typer.Argument(help="Record (CSV).")],
    json: Annotated[Path, typer.Option(help="Verdict to write.")],
    answer: Annotated[Path | None, typer.Option(help="Answer to the record: for the oracle alone.")] = None,
) -> None:
    """Judge one record with a rival method."""
    from benchmarks.hidden_effects.rivals import judge

    judge(name, record, json, answer)


if __name__ == "__main__":  # a process of a pool may load this file under another name
    try:
        app()
    except AdaptiveFlotError as error:
        print(error, file=sys.stderr)
        raise SystemExit(2) from None
