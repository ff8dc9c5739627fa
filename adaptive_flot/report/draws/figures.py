"""Bands over time, and shares of the variance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from adaptive_flot.charts.palette import GREY, SLOTS
from adaptive_flot.charts.plotdata import Chart, Panel, Role, Trace
from adaptive_flot.report.kit import style
from adaptive_flot.report.kit.figures import legend_above
from adaptive_flot.report.kit.wording import spaced
from adaptive_flot.uncertainty.draws import Draws
from adaptive_flot.uncertainty.ranking import Share


def band_chart(draws: Draws, names: Sequence[str]) -> Chart:
    """Inputs that move, then each output: its quantiles over the draws, and with the nominal constants."""
    time, model = draws.record.time, draws.model
    panels = [
        Panel(spaced(q.name), q.unit, (Trace("", time, values, Role.ESTIMATE, index=3, held=True),), height=0.6)
        for q, values in zip(model.inputs, draws.record.inputs.T, strict=True)
        if np.ptp(values) > 0
    ]
    for name in names:
        j = model.index("outputs", name)
        q05, q25, q50, q75, q95 = draws.quantiles(name).T
        traces = (
            Trace("5 % and 95 %", time, q05, Role.ESTIMATE, index=7),
            Trace("", time, q95, Role.ESTIMATE, index=7),
            Trace("25 % and 75 %", time, q25, Role.ESTIMATE, index=0),
            Trace("", time, q75, Role.ESTIMATE, index=0),
            Trace("median", time, q50, Role.ESTIMATE, index=1),
            Trace("nominal constants", time, draws.nominal[:, j], Role.CONSTANT, index=GREY),
        )
        panels.append(Panel(spaced(name), model.outputs[j].unit, traces))
    return Chart(tuple(panels))


@style.styled
def share_figure(shares: Mapping[str, Sequence[Share]]) -> Figure:
    """Shares of the constants in the variance of each output, with 95 % confidence intervals; one panel an output."""
    shown = {name: found for name, found in shares.items() if found}
    labels = [share.label for share in next(iter(shown.values()))]
    figure = Figure(figsize=(style.WIDTH, 1.1 + 0.42 * len(labels)))
    axes: list[Axes] = list(figure.subplots(1, len(shown), sharey=True, squeeze=False)[0])
    for ax, (name, found) in zip(axes, shown.items(), strict=True):
        by_label = {share.label: share for share in found}
        places = np.arange(len(labels))
        for move, what, color in ((-0.17, "total", SLOTS[0][0]), (0.17, "alone", SLOTS[7][0])):
            sizes = [getattr(by_label[label], what) for label in labels]
            halves = [getattr(by_label[label], f"{what}_half") for label in labels]
            label = "with others" if what == "total" else "by itself"
            ax.barh(places + move, sizes, 0.3, xerr=halves, color=color, ecolor="#404040", label=label)
        ax.set_xlabel(f"share in {spaced(name)} [–]")
        ax.set_xlim(left=min(0.0, ax.get_xlim()[0]))
    axes[0].set_yticks(range(len(labels)), labels)
    axes[0].set_ylim(len(labels) - 0.5, -0.5)
    legend_above(figure, axes)
    return figure
