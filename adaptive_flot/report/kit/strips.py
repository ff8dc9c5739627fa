"""Strips over time: which of a few states held when. For statuses and for who decided."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes

from adaptive_flot.charts.block import state_slots
from adaptive_flot.charts.palette import NAMED
from adaptive_flot.charts.plotdata import Strip
from adaptive_flot.report.kit import style

NARROWEST = 0.004
"""Share of the time axis that a state is drawn wide at least: a second in an hour would not be seen."""


def strip_height(strips: Sequence[Strip]) -> float:
    """Height of the axes of some strips [inch]."""
    return 0.3 + 0.28 * len(strips)


def draw_strips(ax: Axes, strips: Sequence[Strip], seconds: float = 1.0) -> None:
    """Draw a row for each strip, a colour for each state that is not the usual one of its row.

    Parameters
    ----------
    ax
        Axes to draw into; a state is named in the legend.
    strips
        Rows from top to bottom, over one time axis.
    seconds
        Unit of the time axis [s].
    """
    begin, end = min(float(s.time[0]) for s in strips), max(float(s.time[-1]) for s in strips)
    slots = state_slots(strips)
    for y, strip in enumerate(strips):
        for state, start, stop in strip.spells():
            width = stop - start if state == strip.usual else max(stop - start, NARROWEST * (end - begin))
            color = style.USUAL if state == strip.usual else NAMED[f"state-{slots[state]}"][0]
            parts = [(start / seconds, width / seconds)]
            ax.broken_barh(parts, (y - 0.36, 0.72), color=color, lw=0, zorder=2 + (state != strip.usual))
    usual = " / ".join(dict.fromkeys(s.usual for s in strips))
    looks = [(usual, style.USUAL), *((state, NAMED[f"state-{slot}"][0]) for state, slot in slots.items())]
    for state, color in looks:
        ax.fill_between([begin / seconds], [0.0], [0.0], color=color, label=state.replace("_", " "))
    ax.set_yticks(range(len(strips)), [s.label for s in strips])
    ax.set_ylim(len(strips) - 0.5, -0.5)
    ax.grid(visible=False, axis="y")
