"""The page of `simulate --draws`: bands of grade and recovery, and which constant makes them wide."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from adaptive_flot.report.draws.figures import band_chart, share_figure
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.page import Page, made_by, render
from adaptive_flot.report.kit.parts import Fact, Part, Section, Table, Text
from adaptive_flot.report.kit.wording import capital, number, spaced
from adaptive_flot.uncertainty.draws import QUANTILES, Draws
from adaptive_flot.uncertainty.in_words import Ranked, sentences, title
from adaptive_flot.uncertainty.ranking import Share


def draws_report(draws: Draws, ranked: Ranked, files: Sequence[Path], command: str = "") -> str:
    """Return the page as HTML, without external parts.

    Parameters
    ----------
    draws, ranked
        The draws, and the shares of the constants for each judged output.
    files
        Files that were read.
    command
        The command as it was typed.
    """
    album = Album()
    others = [q.name for q in draws.model.outputs if q.name not in ranked]
    chart = album.chart(
        band_chart(draws, list(ranked)),
        "Quantiles over the draws at each time, and the run with the nominal constants.",
        "Quantile bands of the judged outputs over time",
    )
    rest = album.chart(band_chart(draws, others), "The same for all other outputs.", "Quantile bands of other outputs")
    page = Page(
        kind="Uncertain constants",
        title=title(ranked),
        lead=f"{len(draws.values)} draws of {len(draws.constants)} constants; inputs: {draws.record.name}.",
        answer=sentences(draws, ranked),
        facts=_facts(draws, ranked),
        first=[chart],
        sections=[
            Section("shares", "Which constant matters", "shares of the variance", _ranking(ranked, album)),
            Section("constants", "Constants", "their ranges, and what was drawn", [_constants(draws)]),
            Section("outputs", "All outputs", "quantiles of the means, other bands", [_outputs(draws), rest]),
        ],
        made=made_by(command, [("Model", draws.model.name), ("Inputs", draws.record.name)], files),
    )
    return render(page, album)


def _facts(draws: Draws, ranked: Ranked) -> list[Fact]:
    lost = len(draws.values) - len(draws.good)
    facts = [Fact("Draws", str(len(draws.values)), f"{lost} left the model's range", "bad" if lost else "")]
    for name in ranked:
        low, high = np.nanquantile(draws.means(name), [QUANTILES[0], QUANTILES[-1]])
        facts.append(Fact(capital(spaced(name)), f"{low:.3g} to {high:.3g}", "mean, 90 % of the draws"))
    return facts


def _ranking(ranked: Ranked, album: Album) -> list[Part]:
    if not any(ranked.values()):
        return [Text("None of the judged outputs changes from draw to draw.")]
    caption = (
        "Share of each constant in the variance of the mean over the record (Sobol' indices): with others, and by "
        "itself. Lines are 95 % confidence intervals; more draws make them shorter."
    )
    picture = album.add(share_figure(ranked), caption, "Bars: share of each constant in the variance")
    return [picture, *(_shares(name, shares) for name, shares in ranked.items() if shares)]


def _shares(name: str, shares: Sequence[Share]) -> Table:
    rows = tuple((s.label, *map(number, (s.total, s.total_half, s.alone, s.alone_half))) for s in shares)
    header = ("Constant", "With others", "±", "By itself", "±")
    return Table(f"{capital(spaced(name))}: shares of the variance of its mean.", header, rows)


def _constants(draws: Draws) -> Table:
    rows = tuple(
        (
            c.parameter.label,
            c.parameter.unit,
            number(c.parameter.value, ".4g"),
            c.in_words,
            *(number(q, ".4g") for q in np.quantile(draws.values[:, k], [0.05, 0.5, 0.95])),
        )
        for k, c in enumerate(draws.constants)
    )
    header = ("Constant", "Unit", "Nominal", "Range", "5 %", "50 %", "95 %")
    return Table("Uncertain constants. All others have their nominal values.", header, rows, words=2)


def _outputs(draws: Draws) -> Table:
    rows = tuple(
        (
            spaced(q.name),
            q.unit,
            number(draws.nominal[:, j].mean(), ".4g"),
            *(number(v, ".4g") for v in np.nanquantile(draws.means(q.name), QUANTILES)),
        )
        for j, q in enumerate(draws.model.outputs)
    )
    header = ("Output", "Unit", "Nominal", *(f"{100 * p:.0f} %" for p in QUANTILES))
    return Table("Quantiles over the draws of the mean over the record.", header, rows, words=2)
