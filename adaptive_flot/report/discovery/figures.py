"""Figures of the discovery report: what each site and driver would explain, and the curve of the effect found."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from adaptive_flot.charts.palette import GREY, colour
from adaptive_flot.charts.plotdata import Panel, Role, Trace
from adaptive_flot.charts.units import exponent, unit_text
from adaptive_flot.discovery.candidates.score_test import Score
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.verdict.words.curve import EffectCurve
from adaptive_flot.report.kit import style
from adaptive_flot.report.kit.figures import legend_above
from adaptive_flot.report.kit.wording import spaced

LEAST_SHOWN = 1e-4
"""Shares of the best candidate below this all look alike."""


@style.styled
def heat_map(scores: Sequence[Score], chosen: Sequence[tuple[str, str]] = ()) -> Figure:
    """Site by driver: first-order gain of each candidate, as a share of the best one's.

    Parameters
    ----------
    scores
        Scores of the catalogue; a site with a driver that was not scored stays white.
    chosen
        (site, driver) to frame.

    Returns
    -------
    Figure
        A logarithmic map; a dot marks what the model's catalogue knows by name.
    """
    sites = list(dict.fromkeys(s.candidate.site.name for s in sorted(scores, key=lambda s: -s.gain)))
    drivers = driver_order(scores)
    table = np.full((len(sites), len(drivers)), np.nan)
    best = max((s.gain for s in scores), default=1.0)
    for s in scores:
        table[sites.index(s.candidate.site.name), drivers.index(s.candidate.driver)] = s.gain / max(best, 1e-300)
    figure = Figure(figsize=(style.WIDTH, 1.7 + 0.27 * len(sites)))
    ax = figure.subplots()
    ax.grid(visible=False)
    shown = np.log10(np.maximum(table, LEAST_SHOWN))
    image = ax.imshow(shown, aspect="auto", cmap="viridis_r", vmin=np.log10(LEAST_SHOWN), vmax=0.0)
    ax.set_xticks(range(len(drivers)), [d.replace("_", " ") for d in drivers], rotation=40, ha="right")
    ax.set_yticks(range(len(sites)), [s.replace("_", " ") for s in sites])
    for s in scores:
        if s.candidate.known:
            at = drivers.index(s.candidate.driver), sites.index(s.candidate.site.name)
            dark = s.gain / max(best, 1e-300) > 0.03
            ax.plot(*at, marker="o", ms=3, color="white" if dark else "black", lw=0)
    for site, driver in chosen:
        if site in sites and driver in drivers:
            corner = drivers.index(driver) - 0.5, sites.index(site) - 0.5
            ax.add_patch(_frame(corner))
    bar = figure.colorbar(image, ax=ax, pad=0.02)
    bar.set_label("gain / best gain [–]")
    ticks = np.arange(np.log10(LEAST_SHOWN), 0.5)
    bar.set_ticks(list(ticks), labels=[f"{10.0**t:g}" for t in ticks])
    return figure


def driver_order(scores: Sequence[Score]) -> list[str]:
    """Drivers from left to right: constant and time first, what only delays last."""
    names = list(dict.fromkeys(s.candidate.driver for s in scores))
    last = ("lag", "delay")
    first = [d for d in ("constant", "time") if d in names]
    return [*first, *sorted(d for d in names if d not in (*first, *last)), *(d for d in last if d in names)]


def _frame(corner: tuple[float, float]) -> Rectangle:
    return Rectangle(corner, 1, 1, fill=False, ec=style.PLAN, lw=2.2, zorder=5, clip_on=False)


@style.styled
def curve_figure(curves: Sequence[EffectCurve]) -> Figure:
    """Each effect over its driver with its 95 % band, and below how often the record was there."""
    figure = Figure(figsize=(style.WIDTH, 3.0 * len(curves)))
    grid = figure.subplots(2 * len(curves), 1, squeeze=False, height_ratios=[4, 1] * len(curves))
    for k, c in enumerate(curves):
        ax, below = grid[2 * k, 0], grid[2 * k + 1, 0]
        power = exponent(c.driver)
        x, seen = c.driver * 10.0**-power, c.seen * 10.0**-power
        own = exponent(c.low, c.high)
        low, middle, high = (v * 10.0**-own for v in (c.low, c.change, c.high))
        ax.fill_between(x, low, high, color=colour(0), alpha=0.22, lw=0, label="95 % band")
        rises = "fitted effect" if c.falling is None else "fitted effect, while the driver rises"
        ax.plot(x, middle, color=colour(0), label=rises)
        if c.falling is not None:
            ax.plot(x, c.falling * 10.0**-own, color=colour(1), ls="--", label="while it falls")
        ax.axhline(1.0 if c.relative else 0.0, color=style.CONSTANT, lw=1.2, ls=(0, (5, 1.5)), label="model as it was")
        ax.set_ylabel(
            f"{'factor on' if c.relative else 'added to'}\n{spaced(c.effect.site)} [{unit_text(c.unit or '-', own)}]"
        )
        below.hist(seen, bins=60, range=(float(x[0]), float(x[-1])), color=style.CONSTANT)
        below.set_ylabel("rows")
        below.set_xlabel(f"{spaced(c.effect.driver)} [{unit_text(c.driver_unit or '-', power)}]")
        for one in (ax, below):
            one.set_xlim(float(x[0]), float(x[-1]))
    figure.align_ylabels(list(grid[:, 0]))
    legend_above(figure, list(grid[::2, 0]))
    return figure


def residual_panels(problem: Problem, before: Fit, after: Fit) -> list[Panel]:
    """Residual of the free run of each output over time, of the model as it is and of the extended one."""
    shown, panels = slice(problem.first_row, None), []
    time = problem.record.time[shown]
    for j, c in enumerate(problem.columns):
        q = before.model.outputs[c]
        traces = [Trace("before", time, before.residual(problem)[shown, j], Role.CONSTANT, GREY)]
        if after is not before:
            traces.append(Trace("after", time, after.residual(problem)[shown, j], Role.ESTIMATE))
        panels.append(Panel(f"{spaced(q.name)}: residual", q.unit, tuple(traces), height=0.8))
    return panels


def run_panels(problem: Problem, before: Fit, after: Fit) -> list[Panel]:
    """Measured values of each output, and free runs of the model as it is and of the extended one."""
    panels, time = [], problem.record.time
    for j, c in enumerate(problem.columns):
        q = before.model.outputs[c]
        traces = [
            Trace("measured", time, problem.measured[:, j], Role.TRUTH),
            Trace("model as it is", time, before.predicted[:, j], Role.CONSTANT, GREY),
        ]
        if after is not before:
            traces.append(Trace("with what was found", time, after.predicted[:, j], Role.ESTIMATE))
        panels.append(Panel(spaced(q.name), q.unit, tuple(traces)))
    return panels
