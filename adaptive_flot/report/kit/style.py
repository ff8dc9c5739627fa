"""The look of every figure, and figures as data URIs. No pyplot: no global state, no display."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import wraps
from typing import Any, Literal, ParamSpec
from urllib.parse import quote

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from adaptive_flot.charts.palette import GREY, NAMED, colour

P = ParamSpec("P")

WIDTH = 7.2
"""Width of every figure [inch]; the page shows it at about this size, so that text in figures keeps its size."""
CONSTANT = colour(GREY)
TRUTH, PLAN, LIMIT, USUAL = (NAMED[name][0] for name in ("truth", "plan", "limit", "usual"))
LARGEST_SVG = 120_000
"""Size [bytes] from which a figure is embedded as PNG: a run of a day would otherwise make a page of many megabytes."""
SMALL_DPI = 90
"""Dots per inch of a picture that only readers without scripts see."""

_PATH = re.compile(rb' d="[^"]*"')
_DIGITS = re.compile(rb"(\.\d\d)\d+")

LOOK: dict[str, Any] = {
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.labelcolor": "#222222",
    "axes.linewidth": 0.8,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 9.5,
    "figure.constrained_layout.use": True,
    "figure.facecolor": "white",
    "font.family": ["DejaVu Sans"],
    "font.size": 9.5,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.6,
    "legend.fontsize": 9.5,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "lines.solid_joinstyle": "round",
    "path.simplify_threshold": 0.3,
    "svg.fonttype": "path",  # outlines: the reader's machine needs no font of ours
    "svg.hashsalt": "adaptive-flot",  # the same figure gives the same bytes
    "xtick.labelsize": 9,
    "ytick.labelsize": 9,
}


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Make a drawing function use the common look, whatever the user's own matplotlib settings are."""

    @wraps(draw)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with _look():
            return draw(*args, **kwargs)

    return wrapped


def _look() -> AbstractContextManager[None]:
    """Use the defaults of matplotlib and our changes; the backend belongs to the caller (figures here need none)."""
    settings: Any = {**matplotlib.rcParamsDefault, **LOOK}
    del settings["backend"]
    return matplotlib.rc_context(settings)


def png_uri(figure: Figure, dpi: int = 160) -> str:
    """Return a figure as a PNG data URI; `dpi` in dots per inch."""
    return "data:image/png;base64," + base64.b64encode(_raster(figure, "png", dpi)).decode("ascii")


def data_uri(figure: Figure, small: bool = False) -> str:
    """SVG where that is small enough (sharp at any size), else PNG; always coarse where it must be `small`."""
    if small:
        return "data:image/webp;base64," + base64.b64encode(_raster(figure, "webp", SMALL_DPI)).decode("ascii")
    svg = _svg(figure)
    return _svg_uri(svg) if len(svg) <= LARGEST_SVG else png_uri(figure)


def _svg_uri(svg: bytes) -> str:
    return "data:image/svg+xml," + quote(svg, safe=" =:/,;()'")  # a quarter smaller than base64


def _raster(figure: Figure, kind: Literal["png", "webp"], dpi: int) -> bytes:
    """The same bytes as those of `Figure.savefig`, which draws everything twice."""
    stream = io.BytesIO()
    with _look():
        figure.set_dpi(dpi)
        canvas = FigureCanvasAgg(figure)
        (canvas.print_png if kind == "png" else canvas.print_webp)(stream)  # type: ignore[no-untyped-call]
    return stream.getvalue()


def _svg(figure: Figure) -> bytes:
    stream = io.BytesIO()
    with _look():
        figure.savefig(stream, format="svg", metadata={"Date": None})
    return _shorter(stream.getvalue())


def _shorter(svg: bytes) -> bytes:
    """Cut coordinates of paths to 0.01 point: nobody sees more, and it halves the page."""
    return _PATH.sub(lambda path: _DIGITS.sub(rb"\1", path.group()), svg)
