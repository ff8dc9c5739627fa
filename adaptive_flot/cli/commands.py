"""The list of commands, and the options before a command."""

from __future__ import annotations

from typing import Annotated

import typer

from adaptive_flot.cli.compare import compare
from adaptive_flot.cli.discover import discover
from adaptive_flot.cli.estimate import estimate
from adaptive_flot.cli.import_ import import_
from adaptive_flot.cli.live.certificates import certificates
from adaptive_flot.cli.live.export import export
from adaptive_flot.cli.live.link import live
from adaptive_flot.cli.live.plant import serve_plant
from adaptive_flot.cli.options import ignore_unknown_backend
from adaptive_flot.cli.run import run
from adaptive_flot.cli.scenarios import scenarios
from adaptive_flot.cli.simulate import simulate
from adaptive_flot.cli.sweep import sweep

app = typer.Typer(
    help="Froth flotation: simulate the cell, track its parameters, report.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
    rich_markup_mode=None,
)
app.command(epilog="Example: adaptive-flot run paper_scenario_1 --estimator rpem --seed 1 --seed 2 --out results/s1")(
    run
)
app.command(epilog="Example: adaptive-flot simulate inputs.csv --out simulated.csv --accurate")(simulate)
app.command(
    name="import", epilog="Example: adaptive-flot import export.csv --map my_map.yaml --out record.parquet --yes"
)(import_)
app.command(
    epilog="Example: adaptive-flot estimate record.csv --fit n --fit C --fit floatability --save-cell fitted.yaml"
)(estimate)
app.command(
    epilog="Example: adaptive-flot discover record.csv --json verdict.json --save-model extended.yaml. "
    "What has changed: adaptive-flot discover today.csv --reference good_week.csv"
)(discover)
app.command(epilog="Example: adaptive-flot compare results/closed_loop_drift/run --out results/comparison")(compare)
app.command(epilog="Example: adaptive-flot sweep paper_1000 --workers 2 --out results/paper_1000")(sweep)
app.command(epilog="Example: adaptive-flot scenarios")(scenarios)
app.command(epilog="Example: adaptive-flot certificates --out certificates")(certificates)
app.command(epilog="Example: adaptive-flot serve-plant closed_loop_drift --speed 5 --write-link link.yaml")(serve_plant)
app.command(epilog="Example: adaptive-flot live link.yaml")(live)
app.command(epilog="Example: adaptive-flot export link.yaml --out record.csv --replay")(export)


@app.callback()
def before_a_command(
    debug: Annotated[
        bool, typer.Option("--debug", help="Show the traceback of an error, and not its last line alone.")
    ] = False,
) -> None:
    """Froth flotation: simulate the cell, track its parameters, report."""
    del debug  # read by `main`, which shows the traceback
    ignore_unknown_backend()
