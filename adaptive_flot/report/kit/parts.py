"""Parts of a page: tables, pictures, lists, headings, and the chapters that hold them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, TypeAlias

import numpy as np

from adaptive_flot.charts.plotdata import Chart
from adaptive_flot.greybox.model import FloatArray

if TYPE_CHECKING:  # what prints tables has no need of Matplotlib
    from adaptive_flot.report.kit.heat import HeatMap


@dataclass(frozen=True)
class Table:
    """A table of text cells.

    Attributes
    ----------
    caption
        What it shows.
    header
        Column headings.
    rows
        Cells, as many a row as headings.
    words
        Number of columns on the left that hold words; the others hold numbers and are set flush right.
    best
        (row, column) of the cells to mark as the best of their column.
    colours
        Colour of each row as `charts.palette` names it ("slot-0"), or none.
    """

    kind: ClassVar[str] = "table"
    caption: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: int = 1
    best: tuple[tuple[int, int], ...] = ()
    colours: tuple[str, ...] = ()

    def with_best(self, column: int, values: FloatArray, least: bool = False) -> Table:
        """Mark the largest (or smallest) of a column's values (R,), all of them where several are the same."""
        known = values[np.isfinite(values)]
        if known.size < 2:
            return self
        target = known.min() if least else known.max()
        return replace(self, best=(*self.best, *((int(i), column) for i in np.flatnonzero(values == target))))


@dataclass(frozen=True, eq=False)
class Picture:
    """A figure of the page: caption, what it shows for readers who do not see it, and one of data URI, chart and map.

    What a chart shows to readers without scripts is drawn with the page: see `Album.stills`.
    """

    kind: ClassVar[str] = "picture"
    caption: str
    alt: str
    uri: str = ""
    chart: Chart | None = None
    heat: HeatMap | None = None


@dataclass(frozen=True)
class Bullets:
    """A list of sentences."""

    kind: ClassVar[str] = "bullets"
    sentences: Sequence[str]


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    kind: ClassVar[str] = "text"
    words: str


@dataclass(frozen=True)
class Heading:
    """A heading within a chapter."""

    kind: ClassVar[str] = "heading"
    words: str


@dataclass(frozen=True)
class Code:
    """A file to copy from the page."""

    kind: ClassVar[str] = "code"
    text: str


Part: TypeAlias = Table | Picture | Bullets | Text | Heading | Code


@dataclass(frozen=True)
class Fact:
    """A number that belongs to the answer: what, how much, and beside what; `tone` is "", "good" or "bad"."""

    what: str
    value: str
    note: str = ""
    tone: str = ""


@dataclass(frozen=True)
class Section:
    """A folded chapter: anchor, title, what is inside in a few words, its parts, and chapters within it.

    Chapters beside each other are open one at a time, so that a page never grows beyond what a reader looks through.
    """

    anchor: str
    title: str
    inside: str
    parts: Sequence[Part]
    chapters: Sequence[Section] = ()


def present(*parts: Part | None) -> list[Part]:
    """Those that there are."""
    return [p for p in parts if p is not None and not (isinstance(p, Bullets) and not p.sentences)]
