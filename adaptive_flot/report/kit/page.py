"""What every report page is made of: tables, numbered pictures, a template, and how the page was made."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING

import jinja2

if TYPE_CHECKING:  # what prints tables has no need of Matplotlib, which takes a while to load
    from matplotlib.figure import Figure

MINUS = "−"


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
    """

    caption: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: int = 1


@dataclass(frozen=True)
class Picture:
    """A figure of the page: number, data URI, caption, and what it shows for readers who do not see it."""

    number: int
    uri: str
    caption: str
    alt: str


@dataclass
class Album:
    """Numbers the pictures of one page in the order they are added."""

    pictures: list[Picture] = field(default_factory=list)

    def add(self, figure: Figure, caption: str, alt: str) -> Picture:
        """Embed a figure and give it the next number."""
        from adaptive_flot.report.kit.style import data_uri

        self.pictures.append(Picture(len(self.pictures) + 1, data_uri(figure), caption, alt))
        return self.pictures[-1]


@dataclass(frozen=True)
class Page:
    """What `base.html` needs.

    Attributes
    ----------
    title, lead
        Heading and first paragraph.
    contents
        (anchor, text) of each chapter.
    made
        (what, value) of each line of the footer.
    """

    title: str
    lead: str
    contents: Sequence[tuple[str, str]]
    made: Sequence[tuple[str, str]]


def render(template: str, page: Page, **content: object) -> str:
    """Render a template of this package; a name the template misses is an error, and all text is escaped."""
    return _environment().get_template(template).render(page=page, **content)


def made_by(command: str, more: Iterable[tuple[str, str]] = ()) -> list[tuple[str, str]]:
    """Lines of the footer: the command (left out if empty), what the caller adds, and the versions."""
    try:
        package = version("adaptive-flot")
    except PackageNotFoundError:  # run from a source tree that is not installed
        package = "not installed"
    first = [("Command", command)] if command else []
    return [*first, *more, ("adaptive-flot", package), ("Python", platform.python_version())]


def number(value: float, form: str = ".2f") -> str:
    """Return a number as text with a true minus sign, none before a zero; a dash where it is not finite.

    >>> number(-1.5), number(float("nan")), number(0.2, "+.1f"), number(-0.004)
    ('−1.50', '–', '+0.2', '0.00')
    """
    if not -float("inf") < value < float("inf"):
        return "–"
    text = f"{value:{form}}"
    zero = not any(digit in text for digit in "123456789")
    return text.lstrip("-") if zero else text.replace("-", MINUS)


def seed_list(seeds: Iterable[int]) -> str:
    """Name seeds briefly.

    >>> seed_list([1, 2, 3]), seed_list([4, 9]), seed_list([1])
    ('3 seeds (1–3)', '2 seeds (4, 9)', 'seed 1')
    """
    listed = list(seeds)
    if len(listed) == 1:
        return f"seed {listed[0]}"
    runs_on = len(listed) > 2 and listed == list(range(listed[0], listed[0] + len(listed)))
    inside = f"{listed[0]}–{listed[-1]}" if runs_on else ", ".join(map(str, listed))
    return f"{len(listed)} seeds ({inside})"


@cache
def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.PackageLoader("adaptive_flot.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
