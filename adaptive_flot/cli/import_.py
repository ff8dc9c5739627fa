"""`adaptive-flot import`: from an export of a plant to a record."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from adaptive_flot.cli.options import CellOption, ModelOption, command_line
from adaptive_flot.targets import check_targets, model_inputs


def import_(
    export: Annotated[Path, typer.Argument(help="Export of a historian or logger: CSV, Parquet or xlsx.")],
    out: Annotated[Path, typer.Option("--out", help="Record to write, .parquet or .csv.")],
    map_: Annotated[
        Path | None, typer.Option("--map", help="From tags to quantities (YAML); what it leaves out is found out.")
    ] = None,
    model: ModelOption = "flotation",
    cell: CellOption = None,
    yes: Annotated[bool, typer.Option("--yes", help="Accept what was found out, and do not ask.")] = False,
    report: Annotated[bool, typer.Option(help="Write a page on the quality of the record beside it.")] = True,
) -> None:
    """Bring an export into the shape of a record: tags, units, times, holes and bad values.

    What the map does not say is found out, shown, and written as a map beside the record.
    """
    from adaptive_flot.cli import import_preview as preview
    from adaptive_flot.files import write_text
    from adaptive_flot.greybox.data.tables import check_table_path, write_table
    from adaptive_flot.processes.registry import make_model
    from adaptive_flot.records.quality.quality import judge
    from adaptive_flot.records.tag_map import TagMap, load_tag_map

    read = [export, map_, *model_inputs(model, cell, export.parent)]
    check_targets(read, [("--out", out)])
    check_table_path(out)
    page, new_map = _free(out.with_suffix(".quality.html")), _free(out.with_suffix(".map.yaml"))
    check_targets(read, [("--out", out), ("--out", page if report else None), ("--out", new_map)])
    given = TagMap() if map_ is None else load_tag_map(map_)
    terminal = sys.stdin.isatty() and sys.stdout.isatty()
    made = make_model(model, cell=cell, folder=export.parent)
    imported = preview.import_asking(export, made, given, preview.ask if terminal else None)
    if yes or terminal or not imported.guessed:
        preview.show(imported)
    preview.check_accepted(imported, yes, terminal)
    table, quality = imported.table(), judge(imported)
    html = ""
    if report:
        from adaptive_flot.report.quality.page import quality_report

        html = quality_report(imported, quality, command=command_line())
    write_table(table, out)
    preview.tell(quality.sentences())
    if imported.tag_map != given:
        write_text(new_map, imported.tag_map.text())
        typer.echo(f"Map: {new_map}")
    if report:
        write_text(page, html)
        typer.echo(f"Quality: {page}")
    typer.echo(f"Record: {out}")


def _free(path: Path) -> Path:
    """A name that no file has: a map or a page that somebody changed is never lost."""
    number = 2
    found = path
    while found.exists():
        found = path.with_name(f"{path.stem}-{number}{path.suffix}")
        number += 1
    return found
