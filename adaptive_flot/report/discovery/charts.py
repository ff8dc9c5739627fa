"""Charts and maps of the discovery report that answer to the pointer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.charts.palette import GREY
from adaptive_flot.charts.plotdata import Chart, Panel, Role, Trace
from adaptive_flot.charts.units import exponent, unit_text
from adaptive_flot.discovery.candidates.score_test import Score
from adaptive_flot.discovery.verdict.words.curve import EffectCurve
from adaptive_flot.report.discovery.figures import LEAST_SHOWN, driver_order
from adaptive_flot.report.kit.heat import Cell, HeatMap, shares
from adaptive_flot.report.kit.wording import spaced

BINS = 60
BACK = 1
"""Place in the palette of what a switch does while its driver falls."""


def score_map(scores: Sequence[Score], chosen: Sequence[tuple[str, str]] = ()) -> HeatMap:
    """Site by driver: gain of each candidate in percent of the best one's; see `figures.heat_map` for the arguments."""
    best = max((s.gain for s in scores), default=1.0)
    sites = list(dict.fromkeys(s.candidate.site.name for s in sorted(scores, key=lambda s: -s.gain)))
    drivers = driver_order(scores)
    looks = shares(np.array([s.gain / max(best, 1e-300) for s in scores]), LEAST_SHOWN)
    cells = {}
    for score, (text, paper, ink) in zip(scores, looks, strict=True):
        c = score.candidate
        words = f"{spaced(c.site.name)}, driven by {spaced(c.driver)}: {text} % of the best gain"
        words += "; known by name" if c.known else ""
        framed = (c.site.name, c.driver) in chosen
        cells[c.site.name, c.driver] = Cell(text, words, paper, ink, c.known, framed)
    rows = [(spaced(site), [cells.get((site, d), Cell("")) for d in drivers]) for site in sites]
    return HeatMap("site", [spaced(d) for d in drivers], rows)


def curve_chart(c: EffectCurve) -> Chart:
    """An effect over its driver with its 95 % band, and below how often the record was there, where it is not time."""
    power = 0 if c.effect.driver == "time" else exponent(c.driver)  # the axis of time has units of its own
    x, seen = c.driver * 10.0**-power, c.seen * 10.0**-power
    unit = c.unit or "-"
    was = Trace("model as it was", x, np.full(len(x), 1.0 if c.relative else 0.0), Role.CONSTANT, GREY)
    risen = "fitted effect" if c.falling is None else "fitted effect, while the driver rises"
    effect = [was, Trace(risen, x, c.change, Role.ESTIMATE, std=(c.high - c.low) / 4)]
    if c.falling is not None:
        effect.append(Trace("while it falls", x, c.falling, Role.ESTIMATE, BACK))
    what = "factor on" if c.relative else "added to"
    panels = [Panel(f"{what} {spaced(c.effect.site)}", unit, tuple(effect), height=1.6)]
    if c.effect.driver != "time":  # rows are where they are in time
        counts, edges = np.histogram(seen, bins=BINS, range=(float(x[0]), float(x[-1])))
        rows = Trace("rows", edges, np.concatenate([counts[:1], counts]).astype(float), Role.ESTIMATE, GREY, held=True)
        panels.append(Panel("rows of the record", "-", (rows,), height=0.6))
    return Chart(tuple(panels), x_label=spaced(c.effect.driver), x_unit=unit_text(c.driver_unit or "-", power))
