"""Print the table of figures: `make bench`."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from benchmarks.speed import rpem_figures, simulation_figures, start_figures


def main() -> None:
    """Measure and print; exits with 0 whatever the figures are."""
    table = Table("figure", "measured", "asked", "met", title="Speed on this machine (medians of one run)")
    for figure in (*simulation_figures(), *rpem_figures(), *start_figures()):
        met = "" if figure.met is None else ("yes" if figure.met else "no")
        table.add_row(figure.what, figure.measured, figure.limit, met)
    console = Console(width=None if Console().is_terminal else 130)
    console.print(table)


main()
