"""What `import` shows before it writes, and how it asks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import click
import typer
from rich.box import HORIZONTALS
from rich.console import Console
from rich.table import Table

from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.tables import Source
from adaptive_flot.greybox.model import Model
from adaptive_flot.records import described
from adaptive_flot.records.importing import Imported, import_table
from adaptive_flot.records.reading.raw import UnclearError, map_line
from adaptive_flot.records.tag_map import TagMap

WIDTH = 80
Ask = Callable[[UnclearError], Mapping[str, str]]


def ask(unclear: UnclearError) -> Mapping[str, str]:
    """Ask the user to choose one of several readings."""
    typer.echo(f"{unclear.question}:")
    for number, keys in enumerate(unclear.choices, start=1):
        typer.echo(f"  {number}  {map_line(unclear.section, keys)}")
    chosen = typer.prompt("Which", type=click.Choice([str(k + 1) for k in range(len(unclear.choices))]))
    return unclear.choices[int(chosen) - 1]


def import_asking(source: Source, model: Model, given: TagMap, answer: Ask | None) -> Imported:
    """Import an export; what is unclear is asked.

    Raises
    ------
    UnclearError
        Something is unclear, and there is nobody to ask.
    DataError, RangeError
        The export can not be used.
    """
    whole = all(given.names(q.name) for q in model.inputs)
    known = given
    while True:
        try:
            return import_table(source, model, known, outputs=not whole)
        except UnclearError as unclear:
            if answer is None:
                raise
            known = known.with_keys(unclear.section, answer(unclear))


def _console() -> Console:
    return Console(width=WIDTH, markup=False, highlight=False)


def tell(sentences: Sequence[str]) -> None:
    """Print sentences, each as a point."""
    console = _console()
    console.print()
    for sentence in sentences:
        console.print(f"- {sentence}")


def show(imported: Imported) -> None:
    """Print what was found, raw beside converted values, and what is done with them."""
    console = _console()
    for line in imported.export.found:
        console.print(f"- {line}")
    table = Table(box=HORIZONTALS, title="Median (lowest to highest good value)", title_justify="left")
    for heading in ("quantity", "tag", "export", "record"):
        table.add_column(heading, overflow="fold")
    for row in described.converted(imported):
        table.add_row(*row)
    console.print(table)
    for name, what in described.done(imported):
        console.print(f"{name}: {what}", soft_wrap=False)
    console.print(described.result(imported))
    if imported.guessed:
        console.print("\nThe map, found out where it was not given:")
        console.print(imported.tag_map.text(), soft_wrap=True, end="")


def check_accepted(imported: Imported, accepted: bool, terminal: bool) -> None:
    """Check that somebody accepts what was found out and not given.

    Raises
    ------
    DataError
        Nobody did.
    """
    if not imported.guessed or accepted:
        return
    guessed = ", ".join(imported.guessed)
    if not terminal:
        raise DataError(
            f"{imported.export.file}: found out and not given: {guessed}; accept it with --yes, or give a map (--map)"
        )
    if not typer.confirm("Is this right?"):
        raise DataError(f"{imported.export.file}: not accepted, nothing is written; put it right in a map (--map)")
