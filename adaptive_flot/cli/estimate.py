"""`adaptive-flot estimate`: a measured record through estimators."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from adaptive_flot.cli.options import (
    CellOption,
    Compile,
    Json,
    MapOption,
    ModelOption,
    Out,
    can_compile,
    command_line,
    once,
    results_folder,
)
from adaptive_flot.plugins import OF_A_RECORD
from adaptive_flot.targets import check_targets, in_folder, model_inputs


def estimate(
    data: Annotated[Path, typer.Argument(help="Measured record, CSV or Parquet; with --map an export.")],
    model: ModelOption = "flotation",
    cell: CellOption = None,
    map_: MapOption = None,
    estimator: Annotated[
        list[str] | None, typer.Option(help=f"Estimator (repeatable); default {', '.join(OF_A_RECORD)}.")
    ] = None,
    fit: Annotated[
        list[str] | None, typer.Option(help="Parameter to estimate (repeatable), or a group of them.")
    ] = None,
    output: Annotated[
        list[str] | None, typer.Option(help="Output to fit to (repeatable); default all measured.")
    ] = None,
    fit_share: Annotated[float, typer.Option(min=0.05, max=0.95, help="Share of the record to fit on.")] = 0.6,
    innovations: Annotated[
        bool | None,
        typer.Option(help="Estimate with process noise too, states and parameters smoothed; default where needed."),
    ] = None,
    save_cell: Annotated[Path | None, typer.Option(help="Write the fitted parameters as a cell file.")] = None,
    save_model: Annotated[Path | None, typer.Option(help="Write the fitted model as a model file (YAML).")] = None,
    report: Annotated[bool, typer.Option(help="Draw the report page too; a batch of records may do without.")] = True,
    out: Out = None,
    json: Json = None,
    compile_: Compile = False,
) -> None:
    """Replay a measured record through fixed, recursive and batch estimation."""
    from adaptive_flot.child_processes import undisturbed
    from adaptive_flot.console.lines import print_estimate, stage_bar
    from adaptive_flot.errors import CellError
    from adaptive_flot.files import write_text
    from adaptive_flot.processes.registry import find_cell, make_model
    from adaptive_flot.records.tag_map import load_tag_map
    from adaptive_flot.runner.commands.estimate import estimate_record
    from adaptive_flot.runner.commands.estimate_files import (
        SMOOTHED,
        estimate_summary,
        replay_file,
        save_fitted_cell,
        save_fitted_model,
        write_replays,
    )
    from adaptive_flot.runner.commands.record_blocks import read_blocks
    from adaptive_flot.runner.commands.runs.run_files import write_json

    if save_cell is not None and model != "flotation":
        raise CellError(f"--save-cell: model {model!r} has no cell file; use --save-model")
    names = once(estimator) or list(OF_A_RECORD)
    folder = results_folder(out, data.stem, "estimate")
    files = [*map(replay_file, names), SMOOTHED, "summary.json", *(["report.html"] if report else [])]
    check_targets(
        [data, map_, *model_inputs(model, cell, data.parent, names)],
        [*in_folder(folder, *files), ("--json", json), ("--save-cell", save_cell), ("--save-model", save_model)],
    )
    made = replace(make_model(model, cell=cell, folder=data.parent), compiled=can_compile(compile_))
    blocks = read_blocks(data, made, fit_share, None if map_ is None else load_tag_map(map_))
    with stage_bar(data.stem) as advance:
        result = estimate_record(
            blocks, made, estimators=names, fit=fit or (), outputs=output or (), folder=data.parent,
            innovations=innovations, progress=advance,
        )  # fmt: skip
    page = ""
    if report:
        from adaptive_flot.report.estimate.page import estimate_report

        page = estimate_report(result, command_line(), [data, *([map_] if map_ is not None else [])])
    with undisturbed():  # no estimates without their page
        write_replays(result, folder)
        for target in filter(None, (folder / "summary.json", json)):
            write_json(target, estimate_summary(data, result))
        if save_cell is not None:
            save_fitted_cell(result, find_cell(cell, data.parent), save_cell)
        if save_model is not None:
            save_fitted_model(result, save_model, base=model, cell=cell, folder=data.parent)
        if report:
            write_text(folder / "report.html", page)
    print_estimate(result)
    typer.echo(f"Report: {folder / 'report.html'}" if report else f"Results: {folder}")
