"""The scripts and styles of charts, as text to put into a page: a page fetches nothing."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from adaptive_flot.charts.palette import style_sheet

SCRIPTS = ("uplot/uPlot.iife.min.js", "text.js", "chart.js", "lines.js", "strips.js")
STYLES = ("uplot/uPlot.min.css", "chart.css")


@cache
def scripts() -> tuple[str, ...]:
    """Scripts in the order in which a page runs them."""
    return tuple(_text(name) for name in SCRIPTS)


@cache
def styles() -> str:
    """Styles: the colours, those of uPlot, and ours."""
    return "\n".join([style_sheet(), *(_text(name) for name in STYLES)])


def _text(name: str) -> str:
    return (files("adaptive_flot.charts") / "assets" / name).read_text(encoding="utf-8").strip()
