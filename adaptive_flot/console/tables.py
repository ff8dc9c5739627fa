"""Tables for a terminal: one that is too wide becomes several below each other, so that no column is lost."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal

from rich.box import HORIZONTALS
from rich.console import Console
from rich.table import Table

from adaptive_flot.report.kit.parts import Table as Content

NAMES = ("Scenario", "Controller", "Estimator", "Result", "Quantity", "Block", "Output", "Effect")
"""Headings of columns that say what a row is of: every part of a table begins with those it has."""
AROUND = 3
"""Letters that a column takes beside its words: the space before, after, and between."""


def print_table(console: Console, content: Content, title: str = "") -> None:
    """Print a table in as many parts as the console needs, its caption below the last."""
    parts = list(fitted(content, console.width))
    for i, part in enumerate(parts):
        table = Table(
            title=title if i == 0 else None,
            title_justify="left",
            show_lines=any("\n" in cell for row in part.rows for cell in row),
            box=HORIZONTALS,
        )
        for j, (heading, width) in enumerate(zip(part.header, widths(part, console.width), strict=True)):
            side: Literal["left", "right"] = "left" if j < part.words else "right"
            table.add_column(heading, justify=side, width=width)
        for row in part.rows:
            table.add_row(*row)
        console.print(table)
    if content.caption:
        console.print(content.caption, style="italic", highlight=False)


def narrowest(content: Content, column: int) -> int:
    """Letters of the longest piece of a column that is not broken: a word, or a whole cell of numbers."""
    pieces = content.header[column].split()
    for row in content.rows:
        pieces += row[column].split() if column < content.words else row[column].split("\n")
    return max(map(len, pieces), default=1)


def widths(content: Content, width: int) -> list[int]:
    """Letters of each column: what it needs so that no word and no number is cut, and more where there is room."""
    found = [narrowest(content, j) for j in range(len(content.header))]
    room = width - 1 - sum(w + AROUND for w in found)
    for j, heading in enumerate(content.header):
        lines = [heading, *(line for row in content.rows for line in row[j].split("\n"))]
        more = max(0, min(room, max(map(len, lines)) - found[j]))
        found[j] += more
        room -= more
    return found


def fitted(content: Content, width: int) -> Iterator[Content]:
    """Parts of a table that fit a width [letters]: the columns that name a row, then as many others as there is room.

    >>> wide = Content("", ("Estimator", "a", "b"), (("rpem", "1" * 30, "2" * 30),))
    >>> [part.header for part in fitted(wide, 60)]
    [('Estimator', 'a'), ('Estimator', 'b')]
    """
    names = [j for j, heading in enumerate(content.header[: content.words]) if heading.capitalize() in NAMES]
    names = names or list(range(min(1, len(content.header))))
    used = 1 + sum(narrowest(content, j) + AROUND for j in names)
    part: list[int] = []
    room = width - used
    for j in (j for j in range(len(content.header)) if j not in names):
        need = narrowest(content, j) + AROUND
        if part and need > room:
            yield _columns(content, names, part)
            part, room = [], width - used
        part.append(j)
        room -= need
    yield _columns(content, names, part)


def _columns(content: Content, names: Sequence[int], more: Sequence[int]) -> Content:
    kept = sorted((*names, *more))
    words = sum(j < content.words for j in kept)
    rows = tuple(tuple(row[j] for j in kept) for row in content.rows)
    return replace(content, header=tuple(content.header[j] for j in kept), rows=rows, words=words)
