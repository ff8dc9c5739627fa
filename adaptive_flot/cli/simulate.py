"""`adaptive-flot simulate`: a table of inputs through a model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from adaptive_flot.cli.options import CellOption, ModelOption
from adaptive_flot.targets import check_targets, model_inputs


def simulate(
    inputs: Annotated[Path, typer.Argument(help="Table with time_s and the input columns (and n, C where they move).")],
    out: Annotated[Path, typer.Option("--out", help="Table to write, .csv or .parquet.")],
    model: ModelOption = "flotation",
    cell: CellOption = None,
    accurate: Annotated[bool, typer.Option("--accurate", help="IDAS on the DAE instead of the fast step.")] = False,
) -> None:
    """Simulate a table of inputs: every state and output column comes out."""
    from adaptive_flot.greybox.data.tables import check_table_path, write_table
    from adaptive_flot.processes.registry import make_model
    from adaptive_flot.runner.commands.simulate import simulate_file

    check_targets([inputs, *model_inputs(model, cell, inputs.parent)], [("--out", out)])
    check_table_path(out)
    table = simulate_file(inputs, make_model(model, cell=cell, folder=inputs.parent), accurate=accurate)
    write_table(table, out)
    typer.echo(f"{len(table)} rows: {out}")
