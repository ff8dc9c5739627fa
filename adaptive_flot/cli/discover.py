"""`adaptive-flot discover`: what physical effect a model lacks, or what has changed since a reference record."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from adaptive_flot.cli.options import CellOption, MapOption, ModelOption, Out, command_line, results_folder
from adaptive_flot.targets import check_targets, in_folder, model_inputs


def discover(
    data: Annotated[
        list[Path],
        typer.Argument(help="Measured record, CSV or Parquet, with --map an export; several are judged together."),
    ],
    reference: Annotated[
        list[Path] | None,
        typer.Option(help="Record on which the model was right (repeatable): tell what has changed since."),
    ] = None,
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
    budget: Annotated[
        float | None,
        typer.Option(min=1.0, help="Seconds after which the search ends with what it has come to."),
    ] = None,
    compile_: Annotated[
        bool,
        typer.Option("--compile/--no-compile", help="Long runs as machine code, where this system has a C compiler."),
    ] = True,
    report: Annotated[bool, typer.Option(help="Draw the report page too; a batch of records may do without.")] = True,
) -> None:
    """Find what physical effect a model lacks, from a measured record, and show the error before and after.

    With a reference, or with several records, it tells what has changed, or what the model lacks in all of them.
    """
    from adaptive_flot.child_processes import undisturbed
    from adaptive_flot.console.lines import print_verdict, stage_bar
    from adaptive_flot.errors import ModelError
    from adaptive_flot.files import write_text
    from adaptive_flot.parallel import available_processes
    from adaptive_flot.processes.registry import make_model
    from adaptive_flot.records.tag_map import load_tag_map
    from adaptive_flot.runner.commands.discover import check_model_path, discover_file, read_limits, save_discovered
    from adaptive_flot.runner.commands.discover_records import discover_records, save_extended
    from adaptive_flot.runner.commands.runs.run_files import write_json

    check_model_path(save_model)
    references, first = list(reference or ()), data[0]
    folder = results_folder(out, first.stem, "discover")
    check_targets(
        [*data, *references, map_, *model_inputs(model, cell, first.parent)],
        [*in_folder(folder, "verdict.json", "report.html"), ("--json", json), ("--save-model", save_model)],
    )
    limits, several = read_limits(limit or ()), bool(references) or len(data) > 1
    if several and limits:
        raise ModelError("--limit: no test is proposed with a reference or for several records; leave it out")
    tag_map = None if map_ is None else load_tag_map(map_)
    made = replace(make_model(model, cell=cell, folder=first.parent), record_code=compile_)
    workers, page = processes or available_processes(), folder / "report.html"
    name = ", ".join(path.stem for path in data)
    with stage_bar(name) as progress:
        if several:
            compared = discover_records(
                data, made, references, tag_map=tag_map, processes=workers, progress=progress, budget=budget
            )
            verdict = compared.verdict
        else:
            searched = discover_file(
                first, made, limits=limits, tag_map=tag_map, processes=workers, budget=budget, progress=progress
            )
            verdict = searched.verdict
    print_verdict(verdict, "usual" if references else "noise")
    drawn = None
    if report:
        from adaptive_flot.report.discovery.page import discovery_report
        from adaptive_flot.report.discovery.records import records_report

        read = [*data, *references, *([map_] if map_ is not None else [])]
        drawn = (
            records_report(compared, name, command_line(), read)
            if several
            else discovery_report(searched, name, command_line(), read)
        )
    with undisturbed():  # no verdict without its page
        for target in filter(None, (folder / "verdict.json", json)):
            write_json(target, verdict.as_dict())
        if drawn is None:
            page.unlink(missing_ok=True)  # that of an earlier verdict
        else:
            write_text(page, drawn)
        if save_model is not None:
            if several:
                saved = save_extended(compared, name, save_model, base=model, cell=cell, folder=first.parent)
            else:
                saved = save_discovered(searched, first, save_model, base=model, cell=cell, folder=first.parent)
    if save_model is not None:
        typer.echo(f"Model: {save_model}" if saved else f"Model: {save_model} not written, nothing was fitted")
    if drawn is not None:
        typer.echo(f"Report: {page}")
