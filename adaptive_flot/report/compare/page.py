"""The page of a comparison: controllers and estimators side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from adaptive_flot.files import write_text
from adaptive_flot.report.compare import answer
from adaptive_flot.report.compare.contenders import roles
from adaptive_flot.report.compare.distribution import distribution_picture
from adaptive_flot.report.compare.paired import paired_table
from adaptive_flot.report.compare.tables import compare_tables, made_table, overview_table, spread_text
from adaptive_flot.report.compare.trajectories import trajectories_picture
from adaptive_flot.report.kit import distributions
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.page import Page, made_by, render
from adaptive_flot.report.kit.parts import Part, Picture, Section, present
from adaptive_flot.report.kit.plotdata import Spread
from adaptive_flot.report.kit.wording import seed_list
from adaptive_flot.runner.commands.comparison import Comparison, seeds_of
from adaptive_flot.runner.commands.runs.runs_table import SUMMARY

SPREADS = (("recovery", "recovery [–]", 1.0), ("below_limit", "below limit [% of time]", 100.0))
"""Columns, axis labels and factors of the panels beside that of the value."""


def write_compare_report(comparisons: Sequence[Comparison], path: Path, command: str = "") -> None:
    """Write the page as a single HTML file without external parts.

    Parameters
    ----------
    comparisons
        What `compare` returned.
    path
        File to write, whole or not at all.
    command
        Command line that made it, for the foot.
    """
    write_text(path, compare_report(comparisons, command))


def compare_report(comparisons: Sequence[Comparison], command: str = "") -> str:
    """Return the page that `write_compare_report` writes."""
    album = Album()
    runs = sum(len(x.runs) for c in comparisons for x in c.contenders)
    one = comparisons[0]
    page = Page(
        kind="Comparison",
        title=answer.title(one) if len(comparisons) == 1 else f"{len(comparisons)} scenarios compared",
        lead=f"{', '.join(c.scenario for c in comparisons)}: {runs} runs, {seed_list(seeds_of(comparisons))}."
        + (" Costs, prices and terms are explained in docs/guides/economics.md." if _earned(comparisons) else ""),
        answer=[s for c in comparisons for s in _said(c, len(comparisons) > 1)],
        facts=answer.facts(one) if len(comparisons) == 1 else [],
        first=_first(comparisons, album),
        sections=[s for i, c in enumerate(comparisons, 1) for s in sections(c, i, len(comparisons) > 1, album)],
        made=made_by(command, [("Results", ", ".join(_results(comparisons)))], _summaries(comparisons)),
    )
    return render(page, album)


def _earned(comparisons: Sequence[Comparison]) -> bool:
    return any(map(answer.is_earned, comparisons))


def _said(comparison: Comparison, several: bool) -> list[str]:
    return [f"{comparison.scenario}: {s}" if several else s for s in answer.sentences(comparison)]


def _first(comparisons: Sequence[Comparison], album: Album) -> list[Part]:
    """What shows the answer: the outcomes, and the trajectories over each other."""
    if len(comparisons) > 1:
        return present(overview_table(comparisons))
    return present(answer.matrix(comparisons[0]), trajectories_picture(comparisons[0], album))


def sections(comparison: Comparison, i: int, several: bool, album: Album, distribution: bool = True) -> list[Section]:
    """Chapters of a scenario: several where it is the only one of a page, else one, the i-th.

    `distribution` is False where the page shows the distributions of a single scenario above.
    """
    if several:
        parts = present(
            answer.matrix(comparison), trajectories_picture(comparison, album), *comparison_parts(comparison, album)
        )
        parts.append(made_table(comparison))
        return [Section(f"scenario-{i}", comparison.scenario, "all tables and figures", parts)]
    paired = paired_table(comparison)
    return [
        *([Section("paired", "Paired differences", "with interval, and wins per seed", [paired])] if paired else []),
        Section("spread", "Distribution over the seeds", "", _pictures(comparison, album, distribution)),
        Section("tables", "All tables", "outcome, terms, fits, statuses, times", compare_tables(comparison)),
        Section("runs", "Who ran", "options, version and commit", [made_table(comparison)]),
    ]


def comparison_parts(comparison: Comparison, album: Album) -> list[Part]:
    """Paired differences, pictures and tables of a scenario."""
    return present(paired_table(comparison), *_pictures(comparison, album), *compare_tables(comparison))


def _results(comparisons: Sequence[Comparison]) -> list[str]:
    """Results as they were given."""
    return list(
        dict.fromkeys(str(r) for c in comparisons for x in c.contenders if "result" in x.runs for r in x.runs["result"])
    )


def _summaries(comparisons: Sequence[Comparison]) -> list[Path]:
    return [p / SUMMARY if p.is_dir() else p for p in map(Path, _results(comparisons))]


def _pictures(comparison: Comparison, album: Album, distribution: bool = True) -> list[Picture]:
    if not answer.is_earned(comparison):
        still = _fit_pictures(comparison, album)
    else:
        still = [_plane(comparison, album), _spread(comparison, album)]
    moving = distribution_picture([comparison], album) if distribution else None
    return [*still, *([] if moving is None else [moving])]


def _plane(comparison: Comparison, album: Album) -> Picture:
    points = {c.label: (c.values("mean_grade"), c.values("recovery")) for c in comparison.contenders}
    figure = distributions.plane_figure(points, roles(comparison), comparison.grade_limit)
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
    figure = distributions.spread_figure(spreads, roles(comparison))
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
    figure = distributions.spread_figure(spreads, roles(comparison))
    return [album.add(figure, _spread_caption(comparison), "Fits by contender")]


def _spread_caption(comparison: Comparison) -> str:
    few = max(len(c.seeds) for c in comparison.contenders) < distributions.FEWEST_FOR_A_BOX
    how = "thick line: median" if few else "box from quartile to quartile with the median, whiskers to the extremes"
    return f"{comparison.scenario}: one point a run; {how}. {spread_text(comparison)}"
