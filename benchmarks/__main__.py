"""Print the table of figures: `make bench`."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from benchmarks.timing.solve_times import do_mpc_figures, hour_figures, solver_figures
from benchmarks.timing.speed import rpem_figures, simulation_figures, start_figures


def main() -> None:
    """Measure and print; exits with 0 whatever the figures are."""
    table = Table("figure", "measured", "asked", "met", title="Speed on this machine (medians of one run)")
    control = (*solver_figures(), *do_mpc_figures(), *hour_figures())
    for figure in (*simulation_figures(), *rpem_figures(), *control, *start_figures()):
        met = "" if figure.met is None else ("yes" if figure.met else "no")
        table.add_row(figure.what, figure.measured, figure.limit, met)
    console = Console(width=None if Console().is_terminal else 130)
    console.print(table)


main()
