"""`adaptive-flot run`: plant, estimators and controller of a scenario together."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from adaptive_flot.cli.options import Compile, Json, MapOption, Out, can_compile, command_line, once, results_folder
from adaptive_flot.targets import check_targets, in_folder, scenario_inputs


def run(
    scenario: Annotated[str, typer.Argument(help="Scenario file, or the name of a shipped scenario.")],
    estimator: Annotated[list[str] | None, typer.Option(help="Estimator (repeatable); default the scenario's.")] = None,
    controller: Annotated[
        list[str] | None, typer.Option(help="Controller (repeatable); default the scenario's.")
    ] = None,
    seed: Annotated[
        list[int] | None, typer.Option(min=0, max=2**63 - 1, help="Noise seed (repeatable); default the scenario's.")
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option(help="Play the inputs of this measured record, CSV or Parquet; with --map an export."),
    ] = None,
    map_: MapOption = None,
    out: Out = None,
    json: Json = None,
    parquet: Annotated[bool, typer.Option("--parquet", help="Write the time series as Parquet, not CSV.")] = False,
    compile_: Compile = False,
) -> None:
    """Run a scenario: plant, estimators and controller together."""
    from adaptive_flot.console.lines import print_closed_loop, print_fits, print_sentences, progress_bar
    from adaptive_flot.errors import ScenarioError
    from adaptive_flot.processes.registry import read_measurements
    from adaptive_flot.records.tag_map import load_tag_map
    from adaptive_flot.runner.commands.runs.run import run_scenario
    from adaptive_flot.runner.commands.runs.run_files import run_summary, write_json, write_runs
    from adaptive_flot.runner.loop.prepared import check_named
    from adaptive_flot.runner.scenario.loading import load_scenario
    from adaptive_flot.runner.scenario.recorded_inputs import on_record

    loaded = load_scenario(scenario)
    if map_ is not None and record is None:
        raise ScenarioError("--map: there is no --record that it belongs to; give both, or neither")
    if record is not None:
        tag_map = None if map_ is None else load_tag_map(map_)
        measured = read_measurements(record, loaded.model, tag_map=tag_map).record
        loaded = on_record(loaded, measured, record, map_)
    loaded = loaded.compiled() if can_compile(compile_) else loaded
    who = once(estimator), once(controller)
    check_named(loaded, *who)
    folder = results_folder(out, loaded.name, "run")
    check_targets(scenario_inputs(loaded, *who), [*in_folder(folder, "summary.json", "report.html"), ("--json", json)])
    print_sentences(dict.fromkeys(f"Inputs of {played.said}" for played in loaded.recorded.values()))
    count = len(loaded.combinations(*who)) * len(once(seed) or set(loaded.file.seeds))
    with progress_bar(loaded.name, count) as advance:
        runs = run_scenario(loaded, who[0], once(seed), advance, who[1])
    write_runs(runs, folder, ".parquet" if parquet else ".csv")
    summary = run_summary(loaded, runs)
    for target in filter(None, (folder / "summary.json", json)):
        write_json(target, summary)
    print_closed_loop(loaded, runs)
    print_fits([(loaded, runs)])
    from adaptive_flot.parallel import available_processes
    from adaptive_flot.report.run.page import write_run_report

    write_run_report([(loaded, runs)], folder / "report.html", command=command_line(), processes=available_processes())
    typer.echo(f"Report: {folder / 'report.html'}")
