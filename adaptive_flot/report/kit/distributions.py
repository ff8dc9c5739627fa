"""Figures of many runs: values over the seeds, and recovery against grade."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from adaptive_flot.charts.plotdata import Role
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.report.kit import style
from adaptive_flot.report.kit.figures import legend_above, look
from adaptive_flot.report.kit.plotdata import Spread

MARKERS = ("o", "s", "^", "D", "v", "P")
MANY_POINTS = 200
"""Values from which points are drawn fainter."""
FEWEST_FOR_A_BOX = 5
"""Values from which quartiles are drawn; fewer are shown as points and their median."""


@style.styled
def spread_figure(spreads: Sequence[Spread], roles: Mapping[str, tuple[Role, int]]) -> Figure:
    """Values over the seeds, a panel a quantity and a row for each who has them.

    Parameters
    ----------
    spreads
        Values of each quantity.
    roles
        Role and colour index of each row, from top to bottom.

    Returns
    -------
    Figure
        Points (one a seed), median, from five seeds on a box from quartile to quartile; diamond at a published value.
    """
    names = list(roles)
    figure = Figure(figsize=(style.WIDTH, 1.05 + 0.5 * len(names)))
    grid = figure.subplots(1, len(spreads), sharey=True, squeeze=False)
    axes: list[Axes] = list(grid[0])
    for ax, spread in zip(axes, spreads, strict=True):
        for y, name in enumerate(names):
            _draw_spread(ax, y, spread.values.get(name, np.empty(0)), look(*roles[name])["color"])
            if name in spread.published:
                ax.plot(spread.published[name], y, "D", ms=7, mfc="white", mec="black", mew=1.3, label="published")
        ax.set_xlabel(spread.label)
        ax.xaxis.set_major_locator(MaxNLocator(4))
        ax.margins(x=0.08)
    axes[0].set_yticks(range(len(names)), names)
    axes[0].set_ylim(len(names) - 0.5, -0.5)
    if any(s.published for s in spreads):
        legend_above(figure, axes)
    return figure


@style.styled
def plane_figure(
    points: Mapping[str, tuple[FloatArray, FloatArray]], roles: Mapping[str, tuple[Role, int]], limit: float
) -> Figure:
    """Recovery against concentrate grade, the plane in which a flotation cell is judged.

    Parameters
    ----------
    points
        Mean grade [-] (S,) and cumulative recovery [-] (S,) of each contender, one entry a seed.
    roles
        Role and colour index of each contender.
    limit
        Lowest grade allowed [-], NaN for none: drawn as a line, the forbidden side shaded.

    Returns
    -------
    Figure
        One marker a run; the shape tells contenders apart where colours can not, and TRUTH is an open one.
    """
    figure = Figure(figsize=(style.WIDTH, 3.6))
    ax = figure.subplots()
    for j, (name, (grade, recovery)) in enumerate(points.items()):
        color, known = look(*roles[name])["color"], roles[name][0] is Role.TRUTH
        dot = {
            "marker": MARKERS[j % len(MARKERS)],
            "mec": color,
            "mfc": "none" if known else color,
            "zorder": 3 + known,
        }
        ax.plot(grade, recovery, ls="", ms=10 if known else 6, alpha=0.75, label=name, **dot)
    low, high = ax.get_xlim()
    if np.isfinite(limit):
        low = min(low, limit - 0.05 * (high - low))
        ax.axvspan(low, limit, color="#f3e3df", lw=0, zorder=0)
        ax.axvline(limit, color="black", lw=1.0, ls=(0, (4, 2)), label="grade limit")
    ax.set_xlim(low, high)
    ax.set_xlabel("mean concentrate grade [–]")
    ax.set_ylabel("recovery [–]")
    legend_above(figure, [ax])
    return figure


def _draw_spread(ax: Axes, y: float, values: FloatArray, color: str) -> None:
    values = values[np.isfinite(values)]
    if not len(values):
        return
    if len(values) >= FEWEST_FOR_A_BOX:
        _draw_box(ax, y, values, color)
    else:
        ax.vlines(np.median(values), y - 0.25, y + 0.25, color=color, lw=2.4)
    jitter = 0.16 * np.resize([-1.0, 0.4, 1.0, -0.4, 0.0], len(values))  # not random: the same data, the same picture
    ax.plot(values, y + jitter, "o", ms=3.2, color=color, alpha=0.55 if len(values) < MANY_POINTS else 0.1, mew=0)


def _draw_box(ax: Axes, y: float, values: FloatArray, color: str) -> None:
    box = {"color": color, "lw": 1.2}
    ax.boxplot(
        values,
        positions=[y],
        orientation="horizontal",
        widths=0.5,
        whis=(0, 100),
        showcaps=False,
        boxprops=box,
        whiskerprops=box,
        medianprops={"color": color, "lw": 2.4},
        manage_ticks=False,
    )
