"""The page itself, as text. Scripts and styles are served by name; the page fetches nothing from anywhere else.

Map
---
page.html, login.html  The two pages.
page.css               Their style.
live.js                The stream, who is logged in, requests.
head.js                The head and the switch.
chart.js               The panels over time, and the strips.
side.js                Alarms, card, shadows, what persons did.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from html import escape
from importlib.resources import files

from adaptive_flot.charts import assets as charts

OWN = ("chart.js", "head.js", "side.js", "live.js")


@cache
def _text(name: str) -> str:
    return (files("adaptive_flot.live.page") / "assets" / name).read_text(encoding="utf-8").strip()


@cache
def scripts() -> str:
    """All scripts, in the order in which they run."""
    return "\n;\n".join([*charts.scripts(), *(_text(name) for name in OWN)])


@cache
def styles() -> str:
    """All styles."""
    return "\n".join([charts.styles(), _text("page.css")])


def page() -> str:
    """The page; it holds no data."""
    return _text("page.html")


def login_page(words: str) -> str:
    """The page to log in, with words on what was wrong; empty where nothing was."""
    return _text("login.html").replace("{{ words }}", escape(words))


def icon() -> str:
    """The sign of the page."""
    return _text("icon.svg")


ASSETS: dict[str, tuple[Callable[[], str], str]] = {
    "page.js": (scripts, "text/javascript"),
    "page.css": (styles, "text/css"),
    "icon.svg": (icon, "image/svg+xml"),
}
"""What is served by name."""
