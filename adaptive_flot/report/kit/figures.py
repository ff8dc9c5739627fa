"""Figures: data in, matplotlib figure out. Nothing here knows of runs or scenarios."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from adaptive_flot.charts.palette import colour
from adaptive_flot.charts.plotdata import Chart, Panel, Role, Trace
from adaptive_flot.charts.thinning import kept_rows
from adaptive_flot.charts.units import exponent, time_unit, unit_text
from adaptive_flot.report.kit import style
from adaptive_flot.report.kit.strips import draw_strips, strip_height

LABEL_WIDTH = 20
"""Letters of an axis label that fit beside a low panel; a longer one is broken between words."""
LEGEND_WIDTH = 90
"""Letters that fit beside each other in a legend as wide as a figure."""
MOST_POINTS = 4000
"""Points of a line; of more, the lowest and highest of each group are drawn."""

_TIME_STEPS = (1, 3, 6, 10)
"""Ticks fall on whole minutes: 300 s, 600 s."""


def time_figure(panels: Sequence[Panel]) -> Figure:
    """Stack panels over a common time axis.

    Parameters
    ----------
    panels
        The panels from top to bottom.

    Returns
    -------
    Figure
        7.2 inch wide; one legend above the panels unless there is but one line a panel.
    """
    return chart_figure(Chart(tuple(panels)))


@style.styled
def chart_figure(chart: Chart) -> Figure:
    """Draw a chart as a figure that does not move: its panels, and below them its strips.

    Returns
    -------
    Figure
        7.2 inch wide. States shorter than 0.4 % of the axis are drawn that wide.
    """
    heights = [1.85 * p.height for p in chart.panels] + ([strip_height(chart.strips)] if chart.strips else [])
    figure = Figure(figsize=(style.WIDTH, 0.85 + sum(heights)))
    grid = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)
    axes: list[Axes] = list(grid[:, 0])
    begin, end = chart.limits()
    unit, seconds = time_unit(end - begin) if chart.over_time else (unit_text(chart.x_unit), 1.0)
    for ax, panel in zip(axes, chart.panels, strict=False):
        _draw_panel(ax, panel, seconds)
    if chart.strips:
        draw_strips(axes[-1], chart.strips, seconds)
    for ax in axes:
        for mark in chart.marks:
            ax.axvline(mark.time / seconds, color=style.LIMIT, ls=":", lw=1.1, zorder=1)
    axes[-1].set_xlabel(f"{chart.x_label} [{unit}]")
    axes[-1].set_xlim(begin / seconds, end / seconds)
    axes[-1].xaxis.set_major_locator(MaxNLocator(7, steps=_TIME_STEPS if seconds == 1.0 and chart.over_time else None))
    figure.align_ylabels(axes)
    if chart.strips or any(len(p.traces) > 1 or p.limits for p in chart.panels):
        legend_above(figure, axes)
    return figure


def look(role: Role, index: int) -> dict[str, Any]:
    """How a line of a role is drawn. The dashes tell constant from estimate where colours can not."""
    if role is Role.TRUTH:
        return {"color": style.TRUTH, "lw": 1.1, "zorder": 3, "ls": ("-", "--", ":", "-.")[index % 4]}
    if role is Role.CONSTANT:
        return {"color": colour(index), "lw": 1.5, "zorder": 2, "ls": (0, (5, 1.5))}
    if role is Role.KNOWING:
        return {"color": style.TRUTH, "lw": 1.1, "zorder": 6, "ls": (0, (4, 3))}
    if role is Role.FOLLOWED:
        return {"color": colour(index), "lw": 1.0, "zorder": 3, "ls": ":"}
    if role is Role.PLAN:
        return {"color": style.PLAN, "lw": 1.1, "zorder": 5, "marker": "o", "ms": 3.5, "markevery": [0]}
    return {"color": colour(index), "zorder": 4}


def _draw_panel(ax: Axes, panel: Panel, seconds: float) -> None:
    zoom = panel.zoom_limits()
    power = exponent(*(t.values for t in panel.followed() or panel.traces), np.array(panel.limits))
    factor = 10.0**-power
    if panel.band is not None:
        ax.axhspan(-panel.band * factor, panel.band * factor, color="#ededed", lw=0, label=panel.band_label)
    for limit in panel.limits:
        ax.axhline(limit * factor, color=style.LIMIT, lw=1.0, ls=(0, (6, 2)), zorder=2.5, label="limit")
    for trace in panel.traces:
        _draw_trace(ax, trace, factor, seconds)
    if zoom is not None:
        ax.set_ylim(zoom[0] * factor, zoom[1] * factor)
    ax.set_ylabel(f"{fill(panel.label, LABEL_WIDTH)}\n[{unit_text(panel.unit, power)}]")
    ax.yaxis.set_major_locator(MaxNLocator(5))


def _draw_trace(ax: Axes, trace: Trace, factor: float, seconds: float) -> None:
    line = look(trace.role, trace.index)
    rows = kept_rows([trace.values], MOST_POINTS)
    time, values = trace.time[rows] / seconds, trace.values[rows] * factor
    ax.plot(time, values, drawstyle="steps-pre" if trace.held else "default", label=trace.label, **line)
    if trace.std is not None and np.any(np.nan_to_num(trace.std) > 0):
        half = 2.0 * trace.std[rows] * factor
        band = {"color": line["color"], "alpha": 0.22, "lw": 0, "zorder": 1}
        ax.fill_between(time, values - half, values + half, label=f"{trace.label}, ±2σ", **band)


def legend_above(figure: Figure, axes: Sequence[Axes]) -> None:
    """Put one legend over all panels of a figure, each entry once."""
    entries: dict[str, Any] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    figure.legend(entries.values(), entries.keys(), loc="outside upper left", ncols=legend_columns(list(entries)))


def legend_columns(labels: Sequence[str]) -> int:
    """Columns of a legend as wide as a figure, in even rows.

    >>> legend_columns(["n", "C"]), legend_columns(["economic_mpc, rpem"] * 5)
    (2, 3)
    """
    widest = max(map(len, labels), default=1) + 7  # handle and spaces
    most = max(1, min(5, LEGEND_WIDTH // widest))
    rows = -(-len(labels) // most)
    return max(1, -(-len(labels) // max(1, rows)))
