"""`adaptive-flot simulate`: a table of inputs through a model, once or with many draws of uncertain constants."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from adaptive_flot.cli.options import CellOption, Compile, ModelOption, can_compile, command_line
from adaptive_flot.errors import DataError, ModelError, OutputError
from adaptive_flot.targets import check_targets, model_inputs


def simulate(
    out: Annotated[Path, typer.Option("--out", help="Table to write, .csv or .parquet.")],
    inputs: Annotated[
        Path | None,
        typer.Argument(help="Table with time_s and the input columns (and n, C where they move)."),
    ] = None,
    model: ModelOption = "flotation",
    cell: CellOption = None,
    accurate: Annotated[bool, typer.Option("--accurate", help="IDAS on the DAE instead of the fast step.")] = False,
    draws: Annotated[
        int | None,
        typer.Option("--draws", help="Draw uncertain constants so often; --cell then names the file of their ranges."),
    ] = None,
    report: Annotated[Path | None, typer.Option("--report", help="With --draws: page to write, .html.")] = None,
    json: Annotated[Path | None, typer.Option("--json", help="With --draws: write the summary here.")] = None,
    compile_: Compile = False,
) -> None:
    """Simulate a table of inputs: every state and output column comes out, and beside them what was measured.

    With --draws the constants of a file of ranges are drawn, and quantiles of each output come out. Without a table
    the air then goes up in four steps over the operating range of the cell.
    """
    from dataclasses import replace

    from adaptive_flot.charts.units import amount
    from adaptive_flot.console.lines import print_sentences
    from adaptive_flot.greybox.data.dataset import read_dataset
    from adaptive_flot.greybox.data.tables import check_table_path, write_table
    from adaptive_flot.processes.registry import make_model
    from adaptive_flot.runner.commands.simulate import misfit, simulate_record, start_of

    if draws is not None:
        if accurate or model != "flotation" or cell is None:
            said = "--accurate" if accurate else "--model" if model != "flotation" else "no --cell"
            raise ModelError(f"--draws: {said}; draws are made with the fast step, and --cell names the file of ranges")
        _simulate_draws(inputs, out, Path(cell), draws, report, json, can_compile(compile_))
        return
    if report is not None or json is not None:
        raise ModelError(f"{'--report' if report is not None else '--json'} needs --draws; give it, or leave this out")
    if inputs is None:
        raise DataError("simulate: no table of inputs; give one, or --draws and a file of ranges")
    check_targets([inputs, *model_inputs(model, cell, inputs.parent)], [("--out", out)])
    check_table_path(out)
    made = make_model(model, cell=cell, folder=inputs.parent)
    record = read_dataset(inputs, made)
    start = start_of(record, made)
    table = simulate_record(replace(record, initial_state=start.state), made, accurate=accurate)
    write_table(table, out)
    told = [f"It starts {start.words}.", *record.notes]
    units = {q.name: q.unit for q in made.outputs}
    errors = [f"{name} {amount(size, units[name])}" for name, size in misfit(table, made).items()]
    if errors:
        told.append(f"Measured minus simulated, root mean square: {', '.join(errors)}.")
    print_sentences(f"- {sentence}" for sentence in told)
    typer.echo(f"{len(table)} rows: {out}")


def _simulate_draws(
    inputs: Path | None, out: Path, ranges: Path, draws: int, report: Path | None, json: Path | None, compiled: bool
) -> None:
    from dataclasses import replace

    from adaptive_flot.console.lines import print_sentences
    from adaptive_flot.files import write_text
    from adaptive_flot.greybox.data.dataset import read_dataset
    from adaptive_flot.greybox.data.tables import check_table_path, write_table
    from adaptive_flot.processes.flotation import read_cell
    from adaptive_flot.runner.commands.runs.run_files import write_json
    from adaptive_flot.uncertainty.default_inputs import default_inputs
    from adaptive_flot.uncertainty.draws import blocks_of, draw
    from adaptive_flot.uncertainty.in_words import ranked_outputs, sentences, summary
    from adaptive_flot.uncertainty.ranges_file import ranges_files, read_ranges

    check_targets([inputs, *ranges_files(ranges)], [("--out", out), ("--report", report), ("--json", json)])
    check_table_path(out)
    if report is not None and report.suffix.lower() not in (".html", ".htm"):
        raise OutputError(f"{report}: the page is written as .html; give such a name")
    read = read_ranges(ranges)
    blocks_of(draws, len(read.constants))
    record = (
        default_inputs(read.model, read_cell(read.files[-1])) if inputs is None else read_dataset(inputs, read.model)
    )
    made = draw(replace(read.model, compiled=compiled), read.constants, record, draws)
    ranked = ranked_outputs(made)
    page = ""
    if report is not None:
        from adaptive_flot.report.draws.page import draws_report

        files = [*([inputs] if inputs is not None else []), *read.files]
        page = draws_report(made, ranked, files, command_line())
    write_table(made.table(), out)
    if report is not None:
        write_text(report, page)
    if json is not None:
        write_json(json, summary(made, ranked))
    print_sentences(sentences(made, ranked))
    typer.echo(f"{len(made.values)} draws: {', '.join(str(p) for p in (out, report, json) if p is not None)}")
