"""Distributions over the seeds, as charts to point at."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.charts.plotdata import Chart, Panel, Role, Trace
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.report.compare.answer import fit_names, is_earned, outcome
from adaptive_flot.report.compare.contenders import roles
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.parts import Picture
from adaptive_flot.report.kit.wording import spaced
from adaptive_flot.runner.commands.comparison import Comparison

FEWEST_SEEDS = 5
"""Seeds from which a distribution is drawn."""
THINNEST = 0.002
"""Width of a line whose values are all the same, as a share of the axis."""
LEFT_OUT = 0.02
"""Share of the runs of each contender, its lowest, that does not stretch the axis."""


def distribution_picture(comparisons: Sequence[Comparison], album: Album) -> Picture | None:
    """Share of the runs below each outcome, a line a contender; None where the seeds are few.

    One scenario: a panel a fit, or the value. Several: a panel a scenario, of what counts in it.
    """
    if max(len(c.seeds) for x in comparisons for c in x.contenders) < FEWEST_SEEDS:
        return None
    if len({is_earned(c) for c in comparisons}) > 1:
        return None
    earned, one = is_earned(comparisons[0]), len(comparisons) == 1
    if one and not earned:
        sets = [
            (f"runs below, {spaced(n.removeprefix('fit_'))}", _values(comparisons[0], n))
            for n in fit_names(comparisons[0])
        ]
        looks = [roles(comparisons[0])] * len(sets)
    else:
        sets = [
            (
                "runs below" if one else f"runs below, {spaced(x.scenario)}",
                {c.label: outcome(x, c) for c in x.contenders},
            )
            for x in comparisons
        ]
        looks = [roles(x) for x in comparisons]
    known = [v[np.isfinite(v)] for _, values in sets for v in values.values()]
    least = min((q for _, values in sets for v in values.values() if np.isfinite(q := _low(v))), default=np.nan)
    most = max((float(v.max()) for v in known if v.size), default=np.nan)
    panels = tuple(
        Panel(label, "%", tuple(_trace(name, v, look[name], least, most) for name, v in values.items() if _enough(v)))
        for (label, values), look in zip(sets, looks, strict=True)
    )
    panels = tuple(p for p in panels if p.traces)
    if not panels:
        return None
    label, unit = ("value", "cu/h") if earned else ("fit" if one else "mean of all fits", "%")
    caption = (
        "Share of the runs that stay below each value of the horizontal axis, one line a contender; further right is "
        "better, steeper is surer. The lowest 2 % of each contender are not shown."
    )
    return album.chart(Chart(panels, x_label=label, x_unit=unit), caption, f"Distribution of {label} over the seeds")


def _values(comparison: Comparison, column: str) -> dict[str, FloatArray]:
    return {c.label: c.values(column) for c in comparison.contenders}


def _enough(values: FloatArray) -> bool:
    return int(np.isfinite(values).sum()) >= FEWEST_SEEDS


def _low(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.quantile(known, LEFT_OUT)) if known.size >= FEWEST_SEEDS else float("nan")


def _trace(name: str, values: FloatArray, look: tuple[Role, int], least: float, most: float) -> Trace:
    """Empirical distribution at Hazen's positions, ``100 (i - 1/2) / n`` percent at the i-th of n values.

    Hazen, *Trans. Am. Soc. Civ. Eng.* 77 (1914) 1539.
    """
    known = np.sort(values[np.isfinite(values)])
    share = 100 * (np.arange(len(known)) + 0.5) / len(known)
    kept = known >= least
    role, slot = look
    if np.ptp(known) < THINNEST * (most - least):  # else nothing is seen of values that are all the same
        known = known + np.linspace(0.0, THINNEST * (most - least), len(known))
    return Trace(name, known[kept], share[kept], Role.KNOWING if role is Role.TRUTH else role, slot)
