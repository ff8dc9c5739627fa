"""`adaptive-flot sweep`: a study of many runs."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from adaptive_flot.child_processes import Terminated
from adaptive_flot.cli.options import Compile, Out, can_compile, command_line, results_folder
from adaptive_flot.targets import check_targets, in_folder, scenario_inputs

INTERRUPTED = 130
FILES = ("study.json", "runs.parquet", "timings.parquet", "report.html")


def sweep(
    study: Annotated[str, typer.Argument(help="Study file, or the name of a shipped study.")],
    workers: Annotated[int | None, typer.Option(min=1, help="Processes on this machine; default one a core.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler to run on instead, tcp://host:8786.")
    ] = None,
    out: Out = None,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Run failed runs again.")] = False,
    compile_: Compile = False,
) -> None:
    """Run a study of many runs. Interrupted, the same command goes on where it was."""
    from adaptive_flot.studies.fork_server import start_fork_server
    from adaptive_flot.studies.study_file import load_study

    loaded = load_study(study)
    folder = results_folder(out, loaded.name, "sweep")
    inputs = [file for arm in loaded.arms for file in scenario_inputs(arm.scenario, arm.estimators, arm.controllers)]
    check_targets(
        [loaded.path, *inputs], in_folder(folder, "study.json", "runs.parquet", "timings.parquet", "report.html")
    )
    if scheduler is None:
        start_fork_server()  # it imports while this process does
    from adaptive_flot.console.study import print_study
    from adaptive_flot.studies.progress import live
    from adaptive_flot.studies.sweep import sweep as run_study

    compiled = can_compile(compile_)
    try:
        with live(loaded.name) as progress:
            outcome = run_study(
                loaded,
                folder,
                workers=workers,
                scheduler=scheduler,
                retry_failed=retry_failed,
                compiled=compiled,
                progress=progress,
            )
    except (KeyboardInterrupt, Terminated) as end:
        sys.stderr.write(f"adaptive-flot: interrupted; results so far are in {folder}, the same command goes on\n")
        sys.exit(end.exit_code if isinstance(end, Terminated) else INTERRUPTED)
    print_study(outcome.table)
    typer.echo(f"{len(outcome.table)} runs, {outcome.from_before} of them from before: {folder / 'runs.parquet'}")
    from adaptive_flot.report.sweep.page import write_sweep_report

    page = folder / "report.html"
    write_sweep_report(loaded, folder, page, command=command_line(), read=[loaded.path, *dict.fromkeys(inputs)])
    typer.echo(f"Report: {page}")
