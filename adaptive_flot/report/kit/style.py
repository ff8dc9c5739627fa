"""The look of every figure, units for axis labels, and figures as data URIs. No pyplot: no global state, no display."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import wraps
from typing import Any, ParamSpec
from urllib.parse import quote

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from adaptive_flot.greybox.model import FloatArray

P = ParamSpec("P")

WIDTH = 7.2
"""Width of every figure [inch]; the page shows it at about this size, so that text in figures keeps its size."""
TRUTH = "#000000"
CONSTANT = "#7f7f7f"
PLAN = "#d55e00"
LIMIT = "#b2182b"
ESTIMATES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Okabe and Ito's palette without its yellow: told apart with every common colour vision."""
LARGEST_SVG = 300_000
"""Size [bytes] from which a figure is embedded as PNG: a run of a day would otherwise make a page of many megabytes."""

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


def colour(index: int) -> str:
    """Colour of the estimator at a place in the list; they repeat after six.

    >>> colour(0) == colour(6)
    True
    """
    return ESTIMATES[index % len(ESTIMATES)]


def exponent(*series: FloatArray) -> int:
    """Power of ten to take out of an axis: 0 for sizes that read well as they are.

    >>> exponent(np.array([9.05e-4, 2.17e-3])), exponent(np.array([0.3])), exponent(np.array([np.nan]))
    (-3, 0, 0)
    """
    largest = max((float(np.max(np.abs(s[np.isfinite(s)]), initial=0.0)) for s in series), default=0.0)
    if largest == 0.0 or 0.01 <= largest < 1e4:
        return 0
    return int(np.floor(np.log10(largest)))


def unit_text(unit: str, power: int = 0) -> str:
    """Return a unit as the axis shows it, with the power of ten taken out of the numbers.

    >>> unit_text("m3/s", -3), unit_text("-"), unit_text("m^n/s"), unit_text("-", -3)
    ('10⁻³ m³/s', '–', 'mⁿ/s', '10⁻³')
    """
    raised = str.maketrans("0123456789-n.", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻ⁿ·")
    text = "" if unit == "-" else unit
    for base in ("m", "s", "V"):
        for old in ("2", "3", "^n", "^0.5"):
            text = text.replace(base + old, base + old.lstrip("^").translate(raised))
    factor = f"10{str(power).translate(raised)}" if power else ""
    return " ".join(filter(None, (factor, text))) or "–"


def amount(value: float, unit: str) -> str:
    """Value and unit as text.

    >>> amount(1.67e-4, "m3/s"), amount(0.5, "-")
    ('1.67 × 10⁻⁴ m³/s', '0.5')
    """
    power = exponent(np.array([value]))
    scaled = f"{value * 10.0**-power:.4g}" + (" ×" if power else "")
    return scaled if unit == "-" and not power else f"{scaled} {unit_text(unit, power)}"


def svg_uri(figure: Figure) -> str:
    """Return a figure as an SVG data URI, for the `src` of an image."""
    return _svg_uri(_saved(figure, "svg"))


def png_uri(figure: Figure, dpi: int = 160) -> str:
    """Return a figure as a PNG data URI; `dpi` in dots per inch."""
    return "data:image/png;base64," + base64.b64encode(_saved(figure, "png", dpi=dpi)).decode("ascii")


def data_uri(figure: Figure) -> str:
    """SVG where that is small enough (sharp at any size), else PNG."""
    svg = _saved(figure, "svg")
    return _svg_uri(svg) if len(svg) <= LARGEST_SVG else png_uri(figure)


def _svg_uri(svg: bytes) -> str:
    return "data:image/svg+xml," + quote(svg, safe=" =:/,;()'")  # a quarter smaller than base64


def _saved(figure: Figure, kind: str, **options: Any) -> bytes:
    stream = io.BytesIO()
    with _look():
        figure.savefig(stream, format=kind, metadata={"Date": None} if kind == "svg" else None, **options)
    return _shorter(stream.getvalue()) if kind == "svg" else stream.getvalue()


def _shorter(svg: bytes) -> bytes:
    """Cut coordinates of paths to 0.01 point: nobody sees more, and it halves the page."""
    return _PATH.sub(lambda path: _DIGITS.sub(rb"\1", path.group()), svg)
