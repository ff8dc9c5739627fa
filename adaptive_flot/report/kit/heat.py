"""A map of two sets of names with a number in each cell: coloured, to point at, and sorted by its headings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.colors import to_hex

from adaptive_flot.greybox.model import FloatArray

DARK = 0.45
"""Luminance of a colour below which text on it is white."""


@dataclass(frozen=True)
class Cell:
    """One cell: its number, what it says in words, colours of paper and ink, and whether it is dotted or framed."""

    text: str
    words: str = ""
    paper: str = ""
    ink: str = ""
    dotted: bool = False
    framed: bool = False


@dataclass(frozen=True)
class HeatMap:
    """A map: what its rows and columns are, their names, and the cells (R x C)."""

    corner: str
    columns: Sequence[str]
    rows: Sequence[tuple[str, Sequence[Cell]]]


def shares(values: FloatArray, least: float) -> list[tuple[str, str, str]]:
    """Number in percent, paper and ink of shares (N,) of a largest one, on a logarithmic scale of colours.

    Parameters
    ----------
    values
        Shares, 1 for the largest.
    least
        Share below which all look alike.

    >>> shares(np.array([1.0, 0.0]), 1e-4)
    [('100', '#440154', '#ffffff'), ('0', '#fde725', '#000000')]
    """
    place = 1.0 - np.log10(np.maximum(values, least)) / np.log10(least)
    colours = matplotlib.colormaps["viridis_r"](place)
    light = colours[:, :3] @ np.array([0.2126, 0.7152, 0.0722])
    return [
        (_percent(float(v)), to_hex(c), "#ffffff" if y < DARK else "#000000")
        for v, c, y in zip(values, colours, light, strict=True)
    ]


def _percent(share: float) -> str:
    value = 100 * share
    if value < 0.01:
        return "0"
    return f"{value:.0f}" if value >= 9.5 else f"{value:.1g}" if value < 1 else f"{value:.1f}"
