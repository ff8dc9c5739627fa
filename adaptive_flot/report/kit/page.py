"""What every report page is made of: the answer, folded chapters, and how the page was made."""

from __future__ import annotations

import base64
import hashlib
import platform
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

import jinja2

from adaptive_flot import provenance
from adaptive_flot.charts import assets
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.parts import Fact, Part, Section


@dataclass(frozen=True)
class Page:
    """What a reader sees.

    Attributes
    ----------
    kind
        What kind of report it is.
    title
        Heading: the answer in a few words.
    lead
        What was asked, of what.
    answer
        Sentences of the answer, the most important first.
    facts
        The numbers of the answer.
    first
        What shows the answer: open, below it.
    sections
        Chapters, folded.
    made
        (what, value) of each line of the foot.
    """

    kind: str
    title: str
    lead: str
    answer: Sequence[str]
    facts: Sequence[Fact]
    first: Sequence[Part]
    sections: Sequence[Section]
    made: Sequence[tuple[str, str]]


def render(page: Page, album: Album) -> str:
    """Return a page as HTML; all text is escaped, and nothing is fetched."""
    scripts = (*assets.scripts(), _own("page.js"))
    return (
        _environment()
        .get_template("page.html")
        .render(
            page=page,
            album=album,
            blocks=album.blocks(),
            stills=album.stills(),
            scripts=scripts,
            policy="; ".join(_policy(scripts)),
            styles=f"{assets.styles()}\n{_own('page.css')}",
        )
    )


def made_by(command: str, more: Iterable[tuple[str, str]] = (), read: Iterable[Path] = ()) -> list[tuple[str, str]]:
    """Lines of the foot: command (if any), what the caller adds, hashes of the files read, date, versions."""
    first = [("Command", command)] if command else []
    last = [("Date", provenance.now()), ("adaptive-flot", provenance.code()), ("Python", platform.python_version())]
    return [*first, *more, *provenance.hashed(read), *last]


def _policy(scripts: Sequence[str]) -> list[str]:
    """Content security policy: nothing is fetched, and no script runs but those of this package."""
    hashes = (base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts)
    allowed = " ".join(f"'sha256-{digits}'" for digits in hashes)
    return ["default-src 'none'", "img-src data:", "style-src 'unsafe-inline'", f"script-src {allowed}"]


@cache
def _own(name: str) -> str:
    return (files("adaptive_flot.report") / "templates" / name).read_text(encoding="utf-8").strip()


@cache
def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.PackageLoader("adaptive_flot.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
