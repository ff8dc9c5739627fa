"""The page of a comparison: controllers and estimators side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from adaptive_flot.files import write_text
from adaptive_flot.report.compare.findings import findings
from adaptive_flot.report.compare.tables import MANY_SEEDS, compare_tables, overview_table, spread_text
from adaptive_flot.report.kit import distributions
from adaptive_flot.report.kit.page import Album, Page, Picture, Table, made_by, render, seed_list
from adaptive_flot.report.kit.plotdata import Role, Spread
from adaptive_flot.runner.commands.comparison import ORACLE, Comparison, seeds_of

SPREADS = (("recovery", "recovery [–]", 1.0), ("below_limit", "below limit [% of time]", 100.0))
"""Columns, axis labels and factors of the panels beside that of the value."""


@dataclass(frozen=True)
class Chapter:
    """One scenario as the template shows it."""

    anchor: str
    title: str
    tables: list[Table]
    findings: list[str]
    pictures: list[Picture]


def write_compare_report(comparisons: Sequence[Comparison], path: Path, command: str = "") -> None:
    """Write the page as a single HTML file without external parts.

    Parameters
    ----------
    comparisons
        What `compare` returned.
    path
        File to write, whole or not at all.
    command
        Command line that made it, for the footer.
    """
    write_text(path, compare_report(comparisons, command))


def compare_report(comparisons: Sequence[Comparison], command: str = "") -> str:
    """Return the page that `write_compare_report` writes."""
    album = Album()
    chapters = [compare_chapter(c, f"scenario-{i}", album) for i, c in enumerate(comparisons, 1)]
    runs = sum(len(x.runs) for c in comparisons for x in c.contenders)
    page = Page(
        title=f"Comparison: {', '.join(c.scenario for c in comparisons)}",
        lead=f"{runs} runs, {seed_list(seeds_of(comparisons))}. Costs, prices and terms are explained in "
        "docs/guides/economics.md.",
        contents=[(c.anchor, c.title) for c in chapters],
        made=made_by(command),
    )
    return render("compare.html", page, overview=overview_table(comparisons), chapters=chapters)


def compare_chapter(comparison: Comparison, anchor: str, album: Album) -> Chapter:
    """Tables, sentences and pictures of one scenario; the pictures take the album's next numbers."""
    return Chapter(
        anchor, comparison.scenario, compare_tables(comparison), findings(comparison), _pictures(comparison, album)
    )


def _pictures(comparison: Comparison, album: Album) -> list[Picture]:
    if not any(c.has("value_cu_h") for c in comparison.contenders):
        return _fit_pictures(comparison, album)
    return [_plane(comparison, album), _spread(comparison, album)]


def _roles(comparison: Comparison) -> dict[str, tuple[Role, int]]:
    """A colour for each contender; the oracle is black."""
    roles: dict[str, tuple[Role, int]] = {}
    for c in comparison.contenders:
        role = Role.TRUTH if c.estimator == ORACLE else Role.ESTIMATE
        roles[c.label] = role, sum(r is role for r, _ in roles.values())
    return roles


def _plane(comparison: Comparison, album: Album) -> Picture:
    points = {c.label: (c.values("mean_grade"), c.values("recovery")) for c in comparison.contenders}
    figure = distributions.plane_figure(points, _roles(comparison), comparison.grade_limit)
    caption = (
        f"{comparison.scenario}: recovery against mean grade, one marker a run. Up and right is better; left of the "
        "dashed line the mean grade is below its limit."
    )
    return album.add(figure, caption, "Recovery against mean grade of each run")


def _spread(comparison: Comparison, album: Album) -> Picture:
    wanted = [("value_cu_h", "value [cu/h]", 1.0), *SPREADS]
    spreads = [
        Spread(label, {c.label: factor * c.values(name) for c in comparison.contenders})
        for name, label, factor in wanted
    ]
    figure = distributions.spread_figure(spreads, _roles(comparison))
    return album.add(figure, _spread_caption(comparison), "Value, recovery and time below the limit by contender")


def _fit_pictures(comparison: Comparison, album: Album) -> list[Picture]:
    names = [m for m in dict.fromkeys(m for c in comparison.contenders for m in c.metrics) if m.startswith("fit_")]
    if not names:
        return []
    spreads = [
        Spread(
            f"fit of {name.removeprefix('fit_').replace('_', ' ')} [%]",
            {c.label: c.values(name) for c in comparison.contenders},
        )
        for name in names
    ]
    figure = distributions.spread_figure(spreads, _roles(comparison))
    pictures = [album.add(figure, _spread_caption(comparison), "Fits by contender")]
    if max(len(c.seeds) for c in comparison.contenders) >= MANY_SEEDS:
        caption = f"{comparison.scenario}: share of the runs whose fit is at most that; further right is better."
        figure = distributions.cumulative_figure(spreads, _roles(comparison))
        pictures.append(album.add(figure, caption, "Cumulative distribution of the fits"))
    return pictures


def _spread_caption(comparison: Comparison) -> str:
    few = max(len(c.seeds) for c in comparison.contenders) < distributions.FEWEST_FOR_A_BOX
    how = "thick line: median" if few else "box from quartile to quartile with the median, whiskers to the extremes"
    return f"{comparison.scenario}: one point a run; {how}. {spread_text(comparison)}"
