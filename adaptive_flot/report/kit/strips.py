"""Strips over time: which of a few states held when. For statuses and for who decided."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.report.kit import style
from adaptive_flot.report.kit.figures import legend_columns

NARROWEST = 0.004
"""Share of the time axis that a state is drawn wide at least: a second in an hour would not be seen."""
QUIET = "#d9d9d9"


@dataclass(frozen=True)
class Strip:
    """One row: label, time [s] (N,) at the end of each interval, and the state in each of them (N,).

    `usual` is the state that needs no attention; it is drawn grey.
    """

    label: str
    time: FloatArray
    states: Sequence[str]
    usual: str


@style.styled
def strip_figure(strips: Sequence[Strip]) -> Figure:
    """Draw a row for each strip, a colour for each state that is not the usual one of its row.

    Parameters
    ----------
    strips
        Rows from top to bottom, over one time axis.

    Returns
    -------
    Figure
        7.2 inch wide. States shorter than 0.4 % of the axis are drawn that wide.
    """
    unusual = list(dict.fromkeys(s for strip in strips for s in strip.states if s != strip.usual))
    usual = " / ".join(dict.fromkeys(s.usual for s in strips))
    looks = [(usual, QUIET), *((state, style.colour(i + 1)) for i, state in enumerate(unusual))]
    entries = [Patch(color=color, label=state.replace("_", " ")) for state, color in looks]
    columns = legend_columns([str(entry.get_label()) for entry in entries])
    height = 0.75 + 0.22 * -(-len(entries) // columns) + 0.28 * len(strips)
    figure = Figure(figsize=(style.WIDTH, height))
    ax = figure.subplots()
    begin, end = min(float(s.time[0]) for s in strips), max(float(s.time[-1]) for s in strips)
    for y, strip in enumerate(strips):
        for state, start, stop in spells(strip):
            width = stop - start if state == strip.usual else max(stop - start, NARROWEST * (end - begin))
            color = QUIET if state == strip.usual else style.colour(unusual.index(state) + 1)
            ax.broken_barh([(start, width)], (y - 0.36, 0.72), color=color, lw=0, zorder=2 + (state != strip.usual))
    ax.set_yticks(range(len(strips)), [s.label for s in strips])
    ax.set_ylim(len(strips) - 0.5, -0.5)
    ax.set_xlim(begin, end)
    ax.set_xlabel("time [s]")
    ax.xaxis.set_major_locator(MaxNLocator(7, steps=(1, 3, 6, 10)))
    ax.grid(visible=False, axis="y")
    figure.legend(handles=entries, loc="outside upper left", ncols=columns)
    return figure


def spells(strip: Strip) -> list[tuple[str, float, float]]:
    """(state, start, stop) of each spell in which a state lasts; intervals end at their time."""
    states = np.asarray(strip.states)
    first = np.flatnonzero(np.r_[True, states[1:] != states[:-1]])
    dt = float(strip.time[1] - strip.time[0]) if len(strip.time) > 1 else 1.0
    starts = strip.time[first] - dt
    return list(
        zip(states[first].tolist(), starts.tolist(), [*starts[1:].tolist(), float(strip.time[-1])], strict=True)
    )
