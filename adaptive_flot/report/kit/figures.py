"""Figures: data in, matplotlib figure out. Nothing here knows of runs or scenarios."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from adaptive_flot.report.kit import style
from adaptive_flot.report.kit.plotdata import Panel, Residuals, Role, Trace

LABEL_WIDTH = 20
"""Letters of an axis label that fit beside a low panel; a longer one is broken between words."""
LEGEND_WIDTH = 90
"""Letters that fit beside each other in a legend as wide as a figure."""
ACF_LAGS = 40
"""Lags of the autocorrelation shown."""
WHITE_BAND = 1.96
"""Half width of the 95 % band of the autocorrelation of white noise, times the root of the number of samples."""

_TIME_STEPS = (1, 3, 6, 10)
"""Ticks fall on whole minutes: 300 s, 600 s."""


@style.styled
def time_figure(panels: Sequence[Panel]) -> Figure:
    """Stack panels over a common time axis [s].

    Parameters
    ----------
    panels
        The panels from top to bottom.

    Returns
    -------
    Figure
        7.2 inch wide; one legend above the panels unless there is but one line a panel.
    """
    heights = [p.height for p in panels]
    figure = Figure(figsize=(style.WIDTH, 0.75 + 1.85 * sum(heights)))
    grid = figure.subplots(len(panels), 1, sharex=True, squeeze=False, height_ratios=heights)
    axes: list[Axes] = list(grid[:, 0])
    for ax, panel in zip(axes, panels, strict=True):
        _draw_panel(ax, panel)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(_time_limits([t for p in panels for t in p.traces if t.role is not Role.PLAN]))
    axes[-1].xaxis.set_major_locator(MaxNLocator(7, steps=_TIME_STEPS))
    figure.align_ylabels(axes)
    if any(len(p.traces) > 1 or p.limits for p in panels):
        legend_above(figure, axes)
    return figure


@style.styled
def residual_figure(rows: Sequence[Residuals]) -> Figure:
    """Normalised innovations: over time, their autocorrelation and their histogram.

    Parameters
    ----------
    rows
        One estimator a row. Missing samples (NaN) are left out.

    Returns
    -------
    Figure
        Three panels a row: trace with the +-2 lines, autocorrelation with the 95 % band of white noise, histogram
        with the standard normal density.
    """
    figure = Figure(figsize=(style.WIDTH, 0.3 + 1.95 * len(rows)))
    grid = figure.subplots(len(rows), 3, squeeze=False, width_ratios=(1.8, 1.2, 1.0))
    for (trace, correlation, histogram), row in zip(grid, rows, strict=True):
        _draw_residuals(trace, row)
        _draw_autocorrelation(correlation, row)
        _draw_histogram(histogram, row)
    for ax, label in zip(grid[-1], ("time [s]", "lag [samples]", "innovation / std [–]"), strict=True):
        ax.set_xlabel(label)
    figure.align_ylabels(grid[:, 0])
    return figure


def look(role: Role, index: int) -> dict[str, Any]:
    """How a line of a role is drawn. The dashes tell constant from estimate where colours can not."""
    if role is Role.TRUTH:
        return {"color": style.TRUTH, "lw": 1.1, "zorder": 3, "ls": ("-", "--", ":", "-.")[index % 4]}
    if role is Role.CONSTANT:
        return {"color": style.CONSTANT, "lw": 1.5, "zorder": 2, "ls": (0, (5, 1.5))}
    if role is Role.KNOWING:
        return {"color": style.TRUTH, "lw": 1.1, "zorder": 6, "ls": (0, (4, 3))}
    if role is Role.FOLLOWED:
        return {"color": style.colour(index), "lw": 1.0, "zorder": 3, "ls": ":"}
    if role is Role.PLAN:
        return {"color": style.PLAN, "lw": 1.1, "zorder": 5, "marker": "o", "ms": 3.5, "markevery": [0]}
    return {"color": style.colour(index), "zorder": 4}


def _draw_panel(ax: Axes, panel: Panel) -> None:
    followed = [t for t in panel.traces if t.role is Role.ESTIMATE] if panel.zoom else []
    power = style.exponent(*(t.values for t in followed or panel.traces), np.array(panel.limits))
    factor = 10.0**-power
    if panel.band is not None:
        ax.axhspan(-panel.band * factor, panel.band * factor, color="#ededed", lw=0, label=panel.band_label)
    for limit in panel.limits:
        ax.axhline(limit * factor, color=style.LIMIT, lw=1.0, ls=(0, (6, 2)), zorder=2.5, label="limit")
    for trace in panel.traces:
        _draw_trace(ax, trace, factor)
    if followed:
        ax.set_ylim(_zoom_limits(panel, followed, factor))
    ax.set_ylabel(f"{fill(panel.label, LABEL_WIDTH)}\n[{style.unit_text(panel.unit, power)}]")
    ax.yaxis.set_major_locator(MaxNLocator(5))


def _time_limits(traces: Sequence[Trace]) -> tuple[float, float]:
    """From the start of the first interval (values belong to its end) to the last time."""
    time = min((t.time for t in traces), key=lambda t: float(t[0]))
    return float(time[0] - (time[1] - time[0] if len(time) > 1 else 1.0)), max(float(t.time[-1]) for t in traces)


def _zoom_limits(panel: Panel, followed: Sequence[Trace], factor: float) -> tuple[float, float]:
    half = 1.5 * (panel.band or 0.0)
    low = min(float(np.nanmin(t.values, initial=-half)) for t in followed) * factor
    high = max(float(np.nanmax(t.values, initial=half)) for t in followed) * factor
    room = 0.08 * (high - low) or 1.0
    return low - room, high + room


def _draw_trace(ax: Axes, trace: Trace, factor: float) -> None:
    line = look(trace.role, trace.index)
    values = trace.values * factor
    ax.plot(trace.time, values, drawstyle="steps-pre" if trace.held else "default", label=trace.label, **line)
    if trace.std is not None and np.any(np.nan_to_num(trace.std) > 0):
        half = 2.0 * trace.std * factor
        band = {"color": line["color"], "alpha": 0.22, "lw": 0, "zorder": 1}
        ax.fill_between(trace.time, values - half, values + half, label=f"{trace.label}, ±2σ", **band)


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


def _draw_residuals(ax: Axes, row: Residuals) -> None:
    color = look(row.role, row.index)["color"]
    ax.plot(row.time, row.values, color=color, lw=0.5)
    for level in (-2.0, 2.0):
        ax.axhline(level, color="black", lw=0.8, ls=(0, (4, 2)))
    ax.set_ylabel("innovation / std [–]")
    ax.set_title(row.label)
    ax.xaxis.set_major_locator(MaxNLocator(4, steps=_TIME_STEPS))
    ax.margins(x=0)


def _draw_autocorrelation(ax: Axes, row: Residuals) -> None:
    from statsmodels.tsa.stattools import acf

    finite = row.values[np.isfinite(row.values)]
    ax.set_title(f"Ljung–Box p {p_text(row.p_value)}")
    ax.set_ylabel("autocorrelation [–]")
    if len(finite) < 3 or np.ptp(finite) == 0:
        ax.text(0.5, 0.5, "too few samples", ha="center", transform=ax.transAxes)
        return
    r = acf(row.values, nlags=min(ACF_LAGS, len(finite) - 1), fft=False, missing="conservative")[1:]
    half = WHITE_BAND / np.sqrt(len(finite))
    ax.axhspan(-half, half, color="#dddddd", lw=0)
    ax.vlines(np.arange(1, len(r) + 1), 0.0, r, color=look(row.role, row.index)["color"], lw=1.6)
    ax.axhline(0.0, color="black", lw=0.8)
    low, high = min(0.0, float(np.min(r)), -half), max(float(np.max(r)), half)
    ax.set_ylim(low - 0.12 * (high - low), high + 0.12 * (high - low))


def p_text(p: float) -> str:
    """Return a p value as text: small ones as a bound, NaN as a dash.

    >>> p_text(0.234), p_text(1e-9), p_text(float("nan"))
    ('= 0.23', '< 0.001', '–')
    """
    if np.isnan(p):
        return "–"
    return "< 0.001" if p < 0.001 else f"= {p:.2g}"


def _draw_histogram(ax: Axes, row: Residuals) -> None:
    finite = row.values[np.isfinite(row.values)]
    bars = {"color": look(row.role, row.index)["color"], "alpha": 0.55}
    if len(finite):
        ax.hist(finite, bins=30, density=True, **bars)
    x = np.linspace(-4.0, 4.0, 161)
    ax.plot(x, np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi), color="black", lw=1.1)
    ax.set_title("histogram, N(0, 1)")
    ax.set_ylabel("density [–]")
