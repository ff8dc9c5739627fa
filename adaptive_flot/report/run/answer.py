"""The answer of a run in open loop: which estimator fits best, and by how much."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.charts.plotdata import Role
from adaptive_flot.report.kit.parts import Fact, Table
from adaptive_flot.report.kit.wording import joined, number, spaced
from adaptive_flot.report.run.findings import findings
from adaptive_flot.report.run.series import CaseRuns
from adaptive_flot.report.run.tables import fits_table, median, quantities, seeds_text

MOST_FACTS = 5
SAME = 0.005
"""Difference [%] that two decimals do not show."""


def title(cases: Sequence[CaseRuns]) -> str:
    """Who fits most quantities best."""
    winners = [best(case, q) for case in cases for q in quantities(case)]
    names = [name for name in winners if name]
    if not names:
        return "No estimate is finite"
    first = max(dict.fromkeys(names), key=names.count)
    return f"{first} fits best" if names.count(first) == len(names) else f"{first} fits best, but not in all"


def sentences(cases: Sequence[CaseRuns]) -> list[str]:
    """Best fits beside those of constant parameters, and how many of the published ones are reached."""
    said = []
    for case in cases:
        where = f"{case.scenario.name}: " if len(cases) > 1 else ""
        parts = [
            f"{spaced(q)} {number(median(case.fits(who, q)))} % ({who}{_beside(case, who, q)})"
            for q in quantities(case)
            if (who := best(case, q))
        ]
        if parts:
            said.append(f"{where}best fit of {joined(parts)}.")
        said += [f"{where}{text}" for text in _published(case)]
    return [text[:1].upper() + text[1:] if len(cases) == 1 else text for text in said]


def facts(cases: Sequence[CaseRuns]) -> list[Fact]:
    """Best fit of each quantity of the first case."""
    case = cases[0]
    found = []
    for q in quantities(case)[:MOST_FACTS]:
        who = best(case, q)
        if who:
            value = f"{number(median(case.fits(who, q)), '.1f')} %"
            found.append(Fact(f"Fit of {spaced(q)}", value, f"{who}{_beside(case, who, q)}"))
    return found


def fit_matrix(case: CaseRuns) -> Table:
    """Estimator by quantity: median fit over the seeds, the best of each column marked; published fits below."""
    names = quantities(case)
    rows = [(who, *(number(median(case.fits(who, q))) for q in names)) for who in case.roles]
    colours = [f"slot-{slot}" if role is not Role.KNOWING else "truth" for role, slot in case.roles.values()]
    for who in case.roles:
        published = [case.published(who, q) for q in names]
        if any(value is not None for value in published):
            rows.append((f"{who}, published", *("–" if v is None else number(v) for v in published)))
            colours.append("paper")
    caption = (
        f"Fit in percent, median over {seeds_text(case)}: parameters over time, and outputs predicted one step ahead. "
        "★: the best."
    )
    table = Table(caption, ("Estimator", *map(spaced, names)), tuple(rows), colours=tuple(colours))
    for j, q in enumerate(names, 1):
        table = table.with_best(j, np.round([median(case.fits(who, q)) for who in case.roles], 2))
    return table


def fits_of(case: CaseRuns) -> Table:
    """Fits with their ranges, beside published ones."""
    return fits_table(case)


def findings_of(case: CaseRuns) -> list[str]:
    """Sentences on fits, whiteness and claimed accuracy."""
    return findings(case)


def best(case: CaseRuns, quantity: str) -> str:
    """Name of the estimator with the largest median fit; "" where none is finite."""
    fits = {who: median(case.fits(who, quantity)) for who in case.roles}
    known = {who: value for who, value in fits.items() if np.isfinite(value)}
    return max(known, key=lambda who: known[who]) if known else ""


def _beside(case: CaseRuns, who: str, quantity: str) -> str:
    constant = [name for name, (role, _) in case.roles.items() if role is Role.CONSTANT and name != who]
    return f"; {constant[0]} {number(median(case.fits(constant[0], quantity)), '.1f')} %" if constant else ""


def _published(case: CaseRuns) -> list[str]:
    gaps = {
        (who, q): median(case.fits(who, q)) - value
        for who in case.roles
        for q in quantities(case)
        if (value := case.published(who, q)) is not None
    }
    known = {pair: gap for pair, gap in gaps.items() if np.isfinite(gap)}
    if not known:
        return []
    below = {pair: gap for pair, gap in known.items() if gap < -SAME}
    if not below:
        return [f"all {len(known)} published fits are reached in the median."]
    (who, q), gap = min(below.items(), key=lambda item: item[1])
    reached = len(known) - len(below)
    return [
        f"{reached} of {len(known)} published fits are reached in the median; {who}, {spaced(q)} stays "
        f"{number(-gap)} points below, the most."
    ]
