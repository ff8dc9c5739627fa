"""The command `adaptive-flot`. Heavy libraries are imported by the command that needs them, so that help is quick."""

from __future__ import annotations

import shlex
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated, TypeVar

import typer

from adaptive_flot.errors import AdaptiveFlotError

T = TypeVar("T")
USER_ERROR = 2
INTERRUPTED = 130

app = typer.Typer(
    help="Froth flotation: simulate the cell, track its parameters, report.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
    rich_markup_mode=None,
)

Out = Annotated[Path | None, typer.Option("--out", help="Folder of the results; default results/<name>.")]
Json = Annotated[Path | None, typer.Option("--json", help="Write the summary here too.")]


def _file_here(model: str) -> str:
    """A model file of this folder goes before one of that name beside the data."""
    return str(Path(model).resolve()) if Path(model).is_file() else model


ModelOption = Annotated[
    str,
    typer.Option(
        "--model",
        callback=_file_here,
        help="flotation, cascaded-tanks, zinc-level, iron-columns, a model file (YAML), or my_file:make_model.",
    ),
]
CellOption = Annotated[str | None, typer.Option("--cell", help="Cell file (YAML), or the name of a shipped one.")]
Compile = Annotated[
    bool, typer.Option("--compile", help="Step and estimators as machine code, by the C compiler of this system.")
]


@app.command(epilog="Example: adaptive-flot run paper_scenario_1 --estimator rpem --seed 1 --seed 2 --out results/s1")
def run(
    scenario: Annotated[str, typer.Argument(help="Scenario file, or the name of a shipped scenario.")],
    estimator: Annotated[list[str] | None, typer.Option(help="Estimator (repeatable); default the scenario's.")] = None,
    controller: Annotated[
        list[str] | None, typer.Option(help="Controller (repeatable); default the scenario's.")
    ] = None,
    seed: Annotated[
        list[int] | None, typer.Option(min=0, help="Noise seed (repeatable); default the scenario's.")
    ] = None,
    out: Out = None,
    json: Json = None,
    parquet: Annotated[bool, typer.Option("--parquet", help="Write the time series as Parquet, not CSV.")] = False,
    compile_: Compile = False,
) -> None:
    """Run a scenario: plant, estimators and controller together."""
    from adaptive_flot.console import print_closed_loop, print_fits, progress_bar
    from adaptive_flot.runner.commands.run import run_scenario
    from adaptive_flot.runner.commands.run_files import run_summary, write_json, write_runs
    from adaptive_flot.runner.scenario.scenario import load_scenario

    loaded = load_scenario(scenario)
    loaded = loaded.compiled() if _can_compile(compile_) else loaded
    who = _once(estimator), _once(controller)
    count = len(loaded.combinations(*who)) * len(_once(seed) or set(loaded.file.seeds))
    with progress_bar(loaded.name, count) as advance:
        runs = run_scenario(loaded, who[0], _once(seed), advance, who[1])
    folder = out or Path("results") / loaded.name
    write_runs(runs, folder, ".parquet" if parquet else ".csv")
    summary = run_summary(loaded, runs)
    for target in filter(None, (folder / "summary.json", json)):
        write_json(target, summary)
    print_fits([(loaded, runs)])
    print_closed_loop(loaded, runs)
    from adaptive_flot.report.run.page import write_run_report

    write_run_report([(loaded, runs)], folder / "report.html", command=_command())
    typer.echo(f"Report: {folder / 'report.html'}")


@app.command(epilog="Example: adaptive-flot simulate inputs.csv --out simulated.csv --accurate")
def simulate(
    inputs: Annotated[Path, typer.Argument(help="Table with time_s and the input columns (and n, C where they move).")],
    out: Annotated[Path, typer.Option("--out", help="Table to write, .csv or .parquet.")],
    model: ModelOption = "flotation",
    cell: CellOption = None,
    accurate: Annotated[bool, typer.Option("--accurate", help="IDAS on the DAE instead of the fast step.")] = False,
) -> None:
    """Simulate a table of inputs: every state and output column comes out."""
    from adaptive_flot.greybox.data.tables import write_table
    from adaptive_flot.processes.registry import make_model
    from adaptive_flot.runner.commands.simulate import simulate_file

    table = simulate_file(inputs, make_model(model, cell=cell, folder=inputs.parent), accurate=accurate)
    write_table(table, out)
    typer.echo(f"{len(table)} rows: {out}")


@app.command(
    epilog="Example: adaptive-flot estimate record.csv --fit n --fit C --fit floatability --save-cell fitted.yaml"
)
def estimate(
    data: Annotated[Path, typer.Argument(help="Measured record, CSV or Parquet.")],
    model: ModelOption = "flotation",
    cell: CellOption = None,
    estimator: Annotated[
        list[str] | None, typer.Option(help="Estimator (repeatable); default fixed, rpem and pem.")
    ] = None,
    fit: Annotated[
        list[str] | None, typer.Option(help="Parameter to estimate (repeatable), or a group of them.")
    ] = None,
    output: Annotated[
        list[str] | None, typer.Option(help="Output to fit to (repeatable); default all measured.")
    ] = None,
    fit_share: Annotated[float, typer.Option(min=0.05, max=0.95, help="Share of the record to fit on.")] = 0.6,
    save_cell: Annotated[Path | None, typer.Option(help="Write the fitted parameters as a cell file.")] = None,
    save_model: Annotated[Path | None, typer.Option(help="Write the fitted model as a model file (YAML).")] = None,
    out: Out = None,
    json: Json = None,
    compile_: Compile = False,
) -> None:
    """Replay a measured record through fixed, recursive and batch estimation."""
    from adaptive_flot.console import print_estimate, progress_bar
    from adaptive_flot.errors import CellError
    from adaptive_flot.processes.registry import find_cell, make_model
    from adaptive_flot.runner.commands.estimate import estimate_record, read_blocks
    from adaptive_flot.runner.commands.estimate_files import (
        estimate_summary,
        save_fitted_cell,
        save_fitted_model,
        write_replays,
    )
    from adaptive_flot.runner.commands.run_files import write_json

    if save_cell is not None and model != "flotation":
        raise CellError(f"--save-cell: model {model!r} has no cell file; use --save-model")
    made = replace(make_model(model, cell=cell, folder=data.parent), compiled=_can_compile(compile_))
    blocks = read_blocks(data, made, fit_share)
    names = estimator or ["fixed", "rpem", "pem"]
    with progress_bar(data.stem, 1 + len(names)) as advance:
        result = estimate_record(
            blocks, made, estimators=names, fit=fit or (), outputs=output or (), folder=data.parent, progress=advance
        )
    folder = out or Path("results") / data.stem
    write_replays(result, folder)
    for target in filter(None, (folder / "summary.json", json)):
        write_json(target, estimate_summary(data, result))
    if save_cell is not None:
        save_fitted_cell(result, find_cell(cell, data.parent), save_cell)
    if save_model is not None:
        save_fitted_model(result, save_model, base=model, cell=cell, folder=data.parent)
    print_estimate(result)
    from adaptive_flot.report.estimate.page import write_estimate_report

    write_estimate_report(result, folder / "report.html", command=_command())
    typer.echo(f"Report: {folder / 'report.html'}")


@app.command(epilog="Example: adaptive-flot discover record.csv --json verdict.json --save-model extended.yaml")
def discover(
    data: Annotated[Path, typer.Argument(help="Measured record, CSV or Parquet.")],
    model: ModelOption = "flotation",
    cell: CellOption = None,
    json: Annotated[Path | None, typer.Option("--json", help="Write the verdict here too.")] = None,
    out: Out = None,
    save_model: Annotated[Path | None, typer.Option(help="Write the extended model as a model file (YAML).")] = None,
    processes: Annotated[
        int | None, typer.Option(min=1, help="Fits that run at once; default as many as there are cores.")
    ] = None,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            help="Range of an input for the test that is proposed (repeatable), input=low:high in SI units; "
            "default where the record has been."
        ),
    ] = None,
    report: Annotated[bool, typer.Option(help="Draw the report page too; a batch of records may do without.")] = True,
) -> None:
    """Find what physical effect a model lacks, from a measured record, and show the error before and after."""
    from adaptive_flot.console import print_discovery, stage_bar
    from adaptive_flot.discovery.fitting.parallel import available_processes
    from adaptive_flot.processes.registry import make_model
    from adaptive_flot.runner.commands.discover import check_model_path, discover_file, read_limits, save_discovered
    from adaptive_flot.runner.commands.run_files import write_json

    check_model_path(save_model)
    limits = read_limits(limit or ())
    made = make_model(model, cell=cell, folder=data.parent)
    with stage_bar(data.stem) as progress:
        found = discover_file(
            data, made, limits=limits, processes=processes or available_processes(), progress=progress
        )
    folder = out or Path("results") / data.stem
    for target in filter(None, (folder / "verdict.json", json)):
        write_json(target, found.verdict.as_dict())
    print_discovery(found)
    if save_model is not None:
        saved = save_discovered(found, data, save_model, base=model, cell=cell, folder=data.parent)
        typer.echo(f"Model: {save_model}" if saved else f"Model: {save_model} not written, nothing was fitted")
    page = folder / "report.html"
    if not report:
        page.unlink(missing_ok=True)  # that of an earlier verdict
        return
    from adaptive_flot.report.discovery.page import write_discovery_report

    write_discovery_report(found, data.stem, page, command=_command())
    typer.echo(f"Report: {page}")


@app.command(epilog="Example: adaptive-flot compare results/closed_loop_drift --out results/comparison")
def compare(
    results: Annotated[
        list[Path], typer.Argument(help="Folder (or its summary.json) of `run` or of a study; several may be given.")
    ],
    out: Annotated[Path | None, typer.Option("--out", help="Folder of the report; default none is written.")] = None,
    json: Annotated[Path | None, typer.Option("--json", help="Write the comparison as JSON here.")] = None,
    markdown: Annotated[Path | None, typer.Option("--markdown", help="Write the tables as Markdown here.")] = None,
) -> None:
    """Put controllers and estimators of one or several results side by side, scenario by scenario."""
    from adaptive_flot.console import print_comparison
    from adaptive_flot.files import write_text
    from adaptive_flot.report.compare import tables as compare_tables
    from adaptive_flot.report.compare.findings import findings
    from adaptive_flot.report.compare.page import write_compare_report
    from adaptive_flot.runner.commands import comparison
    from adaptive_flot.runner.commands.run_files import write_json
    from adaptive_flot.runner.commands.runs_table import read_runs

    found = comparison.compare(read_runs(results))
    tables = [compare_tables.compare_tables(c) for c in found]
    overview = [table for table in (compare_tables.overview_table(found),) if table is not None]
    if json is not None:
        write_json(json, {"comparisons": [c.summary() for c in found]})
    if markdown is not None:
        write_text(markdown, "\n".join(compare_tables.markdown(t) for ts in (overview, *tables) for t in ts))
    if out is not None:
        write_compare_report(found, out / "comparison.html", command=_command())
    for one, shown in zip(found, tables, strict=True):
        print_comparison(shown, findings(one))
    print_comparison(overview, [])
    if out is not None:
        typer.echo(f"Report: {out / 'comparison.html'}")


@app.command(epilog="Example: adaptive-flot sweep paper_1000 --workers 2 --out results/paper_1000")
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
    from adaptive_flot.studies.progress import live, print_study
    from adaptive_flot.studies.study_file import load_study
    from adaptive_flot.studies.sweep import sweep as run_study

    loaded = load_study(study)
    folder = out or Path("results") / loaded.name
    compiled = _can_compile(compile_)
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
    except KeyboardInterrupt:
        sys.stderr.write(f"adaptive-flot: interrupted; results so far are in {folder}, the same command goes on\n")
        sys.exit(INTERRUPTED)
    print_study(outcome.table)
    typer.echo(f"{len(outcome.table)} runs, {outcome.found} of them from before: {folder / 'runs.parquet'}")


@app.command(epilog="Example: adaptive-flot scenarios")
def scenarios() -> None:
    """List the shipped scenarios with a line each."""
    import yaml

    from adaptive_flot.runner.scenario.scenario import shipped_scenarios

    shipped = shipped_scenarios()
    width = max(map(len, shipped), default=0)
    for name, path in shipped.items():
        typer.echo(f"{name:{width}}  {yaml.safe_load(path.read_text())['description']}")


def main() -> None:
    """Entry point: a user's mistake is one line on standard error and exit code 2."""
    try:
        app()
    except AdaptiveFlotError as error:
        sys.stderr.write(f"adaptive-flot: {' '.join(str(error).split())}\n")
        sys.exit(USER_ERROR)


def _can_compile(asked: bool) -> bool:
    """Whether to compile; where it is asked for and nothing can be compiled, one line says why."""
    if not asked:
        return False
    from adaptive_flot.greybox.stepping.compiled import compiler_problem

    problem = compiler_problem()
    if problem is not None:
        sys.stderr.write(f"adaptive-flot: --compile: {problem}; going on without, the results are the same\n")
    return problem is None


def _once(given: list[T] | None) -> list[T]:
    """What a repeatable option was given, each once."""
    return list(dict.fromkeys(given or ()))


def _command() -> str:
    return shlex.join(["adaptive-flot", *sys.argv[1:]])
