"""Command line: `python -m benchmarks.with_reference generate|score|judge`."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from adaptive_flot.files import replace_file, write_text
from benchmarks.hidden_effects.__main__ import progress
from benchmarks.hidden_effects.score.commands import run_command
from benchmarks.hidden_effects.score.figures import discover_command
from benchmarks.plant_like.__main__ import make_missing
from benchmarks.plant_like.score import figures, results
from benchmarks.with_reference.record import make_record

app = typer.Typer(help=__doc__, no_args_is_help=True, pretty_exceptions_enable=False, add_completion=False)
Jobs = Annotated[int, typer.Option(min=1, max=64, help="Processes.")]


@app.callback()
def _main() -> None:
    """Records of the flotation cell with a reference, and the score of what is told."""


def _make(job: tuple[Path, int, int]) -> None:
    folder, seed, k = job
    made = make_record(seed, k)
    for kind, table in (("references", made.reference), ("records", made.new)):
        with replace_file(folder / kind / f"record_{k:04d}.csv") as stream:
            table.to_csv(stream, index=False, float_format="%.6e", lineterminator="\n")
    write_text(folder / "answers" / f"record_{k:04d}.json", json.dumps(made.answer, indent=1) + "\n")


@app.command()
def generate(
    out: Annotated[Path, typer.Option(help="Folder of the records; what it holds already is kept.")],
    count: Annotated[int, typer.Option(min=1, help="Number of records.")] = 48,
    seed: Annotated[int, typer.Option(min=0, help="Seed; record k is the same whatever the count.")] = 43,
    jobs: Jobs = 2,
) -> None:
    """Write records, references and answers."""
    make_missing(_make, out, seed, count, jobs)


@app.command()
def judge(
    record: Annotated[Path, typer.Argument(help="A record; its reference is in the folder `references` beside.")],
    json_: Annotated[Path, typer.Option("--json", help="Write the verdict here.")],
) -> None:
    """Judge one record with its reference."""
    reference = record.parent.parent / "references" / record.name
    out = ["--out", str(json_.parent / "out" / record.stem), "--json", str(json_), "--no-report", "--processes", "1"]
    command = [sys.executable, "-m", "adaptive_flot", "discover", str(record), "--reference", str(reference), *out]
    raise typer.Exit(subprocess.run(command, check=False).returncode)


@app.command()
def score(
    folder: Annotated[Path, typer.Argument(help="Folder of the records.")],
    label: Annotated[str, typer.Option(help="Name of the run.")] = "reference",
    alone: Annotated[bool, typer.Option(help="Judge the new record without its reference, for comparison.")] = False,
    jobs: Jobs = 2,
    timeout: Annotated[float, typer.Option(min=1.0, help="Seconds after which a record is given up.")] = 600.0,
) -> None:
    """Judge every record, each with its reference, and print how often what has changed is told."""
    count = len(list((folder / "answers").glob("*.json")))
    if not count:
        raise typer.BadParameter(f"{folder}: no answers; make some with `python -m benchmarks.with_reference generate`")
    with_reference = f"{sys.executable} -m benchmarks.with_reference judge {{record}} --json {{json}}"
    command = discover_command() if alone else with_reference
    with progress() as bar:
        task = bar.add_task(label, total=count)
        run_command(folder, label, command, jobs, timeout, lambda: bar.advance(task))
    table, shown = results(folder, label), Table(title=label, title_justify="left")
    with replace_file(folder / "runs" / label / "results.csv") as stream:
        table.to_csv(stream, index=False, lineterminator="\n")
    console = Console()
    console.print(table.to_string(index=False), markup=False)
    for heading in ("figure", "count", "share"):
        shown.add_column(heading)
    for row in figures(table).astype(str).itertuples(index=False):
        shown.add_row(*row)
    console.print(shown)


if __name__ == "__main__":
    app(prog_name="python -m benchmarks.with_reference")
