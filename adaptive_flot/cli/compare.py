"""`adaptive-flot compare`: controllers and estimators of several results side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from adaptive_flot.cli.options import command_line
from adaptive_flot.targets import check_targets, in_folder


def compare(
    results: Annotated[
        list[Path], typer.Argument(help="Folder (or its summary.json) of `run` or of a study; several may be given.")
    ],
    out: Annotated[Path | None, typer.Option("--out", help="Folder of the report; default none is written.")] = None,
    json: Annotated[Path | None, typer.Option("--json", help="Write the comparison as JSON here.")] = None,
    markdown: Annotated[Path | None, typer.Option("--markdown", help="Write the tables as Markdown here.")] = None,
) -> None:
    """Put controllers and estimators of one or several results side by side, scenario by scenario."""
    from adaptive_flot.console.lines import print_comparison
    from adaptive_flot.files import write_text
    from adaptive_flot.report.compare import tables as compare_tables
    from adaptive_flot.report.compare.findings import findings
    from adaptive_flot.report.compare.page import write_compare_report
    from adaptive_flot.runner.commands import comparison
    from adaptive_flot.runner.commands.runs.run_files import write_json
    from adaptive_flot.runner.commands.runs.runs_table import read_runs, result_files

    check_targets(
        result_files(results),
        [
            ("--json", json),
            ("--markdown", markdown),
            *([] if out is None else in_folder(out, "comparison.html")),
        ],
    )
    found = comparison.compare(read_runs(results))
    tables = [compare_tables.compare_tables(c) for c in found]
    overview = [table for table in (compare_tables.overview_table(found),) if table is not None]
    if json is not None:
        write_json(json, {"comparisons": [c.summary() for c in found]})
    if markdown is not None:
        write_text(markdown, "\n".join(compare_tables.markdown(t) for ts in (overview, *tables) for t in ts))
    if out is not None:
        write_compare_report(found, out / "comparison.html", command=command_line())
    print_comparison(overview, [])
    for one, shown in zip(found, tables, strict=True):
        print_comparison(shown, findings(one))
    if out is not None:
        typer.echo(f"Report: {out / 'comparison.html'}")
