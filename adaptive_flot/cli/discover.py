"""`adaptive-flot discover`: what physical effect a model lacks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from adaptive_flot.cli.options import CellOption, MapOption, ModelOption, Out, command_line, results_folder
from adaptive_flot.targets import check_targets, in_folder, model_inputs


def discover(
    data: Annotated[Path, typer.Argument(help="Measured record, CSV or Parquet; with --map an export.")],
    model: ModelOption = "flotation",
    cell: CellOption = None,
    map_: MapOption = None,
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
    from adaptive_flot.records.tag_map import load_tag_map
    from adaptive_flot.runner.commands.discover import check_model_path, discover_file, read_limits, save_discovered
    from adaptive_flot.runner.commands.run_files import write_json

    check_model_path(save_model)
    folder = results_folder(out, data.stem, "discover")
    check_targets(
        [data, map_, *model_inputs(model, cell, data.parent)],
        [*in_folder(folder, "verdict.json", "report.html"), ("--json", json), ("--save-model", save_model)],
    )
    limits = read_limits(limit or ())
    tag_map = None if map_ is None else load_tag_map(map_)
    made = make_model(model, cell=cell, folder=data.parent)
    with stage_bar(data.stem) as progress:
        found = discover_file(
            data,
            made,
            limits=limits,
            tag_map=tag_map,
            processes=processes or available_processes(),
            progress=progress,
        )
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

    write_discovery_report(found, data.stem, page, command=command_line())
    typer.echo(f"Report: {page}")
