"""Command line: `python -m benchmarks.other_processes generate|discover|score`."""

from __future__ import annotations

import json
import os
import shlex
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from adaptive_flot.files import replace_file, write_text
from benchmarks.hidden_effects.__main__ import progress
from benchmarks.hidden_effects.score.commands import run_command
from benchmarks.other_processes.further import FURTHER
from benchmarks.other_processes.plants import PROCESSES
from benchmarks.other_processes.process import Process
from benchmarks.other_processes.record import make_record
from benchmarks.other_processes.score import by_process, told
from benchmarks.other_processes.without_a_site import WITHOUT_A_SITE
from benchmarks.plant_like.__main__ import make_missing
from benchmarks.plant_like.score import figures, results

app = typer.Typer(help=__doc__, no_args_is_help=True, pretty_exceptions_enable=False, add_completion=False)
Jobs = Annotated[int, typer.Option(min=1, max=64, help="Processes.")]


@app.callback()
def _main() -> None:
    """Records of processes that are not flotation, and the score of whoever tries to find what is missing."""


def _make(job: tuple[Path, int, int], processes: Sequence[Process]) -> None:
    folder, seed, k = job
    made, name = make_record(seed, k, processes), f"record_{k:04d}"
    for table, file in ((made.table, name), (made.reference, f"reference_{k:04d}")):
        if table is not None:
            with replace_file(folder / "records" / f"{file}.csv") as stream:
                table.to_csv(stream, index=False, float_format="%.7g", lineterminator="\n")
    write_text(folder / "records" / f"{name}.json", json.dumps(made.told, indent=1) + "\n")
    write_text(folder / "answers" / f"{name}.json", json.dumps(made.answer, indent=1) + "\n")


@app.command()
def generate(
    out: Annotated[Path, typer.Option(help="Folder of the records; what it holds already is kept.")],
    count: Annotated[int, typer.Option(min=1, help="Number of records.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="Seed; record k is the same whatever the count.")] = 2029,
    jobs: Jobs = 2,
    further: Annotated[bool, typer.Option("--further", help="Of the four further processes.")] = False,
    without_a_site: Annotated[
        bool, typer.Option("--without-a-site", help="Of four processes with what their models have no site for.")
    ] = False,
) -> None:
    """Write records and answers."""
    processes = WITHOUT_A_SITE if without_a_site else FURTHER if further else PROCESSES
    make_missing(partial(_make, processes=processes), out, seed, count, jobs)


@app.command()
def discover(
    record: Annotated[Path, typer.Argument(help="Record of this benchmark.")],
    json_: Annotated[Path, typer.Option("--json", help="Write the verdict here.")],
) -> None:
    """Judge one record with the model, and the reference where there is one, that its user has."""
    model = json.loads(record.with_suffix(".json").read_text())
    old = record.with_name(record.name.replace("record", "reference"))
    out = json_.with_suffix("")
    options = ["--model", model["model"], "--json", str(json_), "--processes", "1", "--no-report", "--out", str(out)]
    options += ["--reference", str(old)] if model["reference"] else []
    words = [sys.executable, "-m", "adaptive_flot", "discover", str(record), *options]
    os.execv(sys.executable, words)


@app.command()
def score(
    folder: Annotated[Path, typer.Argument(help="Folder of the records.")],
    label: Annotated[str, typer.Option(help="Name of the run.")] = "discover",
    jobs: Jobs = 1,
    timeout: Annotated[float, typer.Option(min=1.0, help="Seconds for a record.")] = 600.0,
    count: Annotated[int | None, typer.Option(min=1, help="Only the first records.")] = None,
) -> None:
    """Judge every record and print how often the verdict is right; what is judged already is kept."""
    command = f"{shlex.quote(sys.executable)} -m benchmarks.other_processes discover {{record}} --json {{json}}"
    total = count or len(list((folder / "answers").glob("record_*.json")))
    with progress() as bar:
        task = bar.add_task(label, total=total)
        run_command(folder, label, command, jobs, timeout, lambda: bar.advance(task), count)
    table = results(folder, label, told)
    with replace_file(folder / "runs" / label / "results.csv") as stream:
        table.to_csv(stream, index=False, lineterminator="\n")
    for part in (table, by_process(table), figures(table)):
        print(part.to_string(index=False))


if __name__ == "__main__":
    app()
