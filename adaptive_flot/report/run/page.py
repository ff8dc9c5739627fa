"""The report of scenario runs: one self-contained page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from adaptive_flot.files import write_text
from adaptive_flot.report.compare import page as compare
from adaptive_flot.report.kit import distributions, figures
from adaptive_flot.report.kit.page import Album, Page, Picture, Table, made_by, render, seed_list
from adaptive_flot.report.kit.plotdata import Panel
from adaptive_flot.report.run import series, tables
from adaptive_flot.report.run.closed_loop_figures import Sections, closed_loop_sections
from adaptive_flot.report.run.cramer_rao_limit import LimitPart, limit_part
from adaptive_flot.report.run.fault_table import fault_table
from adaptive_flot.report.run.findings import below_published, candidates, findings
from adaptive_flot.report.run.inquiries import Watch, watch_section
from adaptive_flot.report.run.series import CaseRuns
from adaptive_flot.report.run.unsolved import unsolved_table
from adaptive_flot.runner.commands.comparison import compare_runs
from adaptive_flot.runner.commands.run_result import Run
from adaptive_flot.runner.scenario.scenario import Scenario


@dataclass(frozen=True)
class Chapter:
    """One scenario (and controller) as the template shows it."""

    anchor: str
    title: str
    description: str
    source: str
    fits: Table
    findings: list[str]
    spread: Picture | None
    time_series: Sections
    watch: Watch | None
    parameters: Picture
    parameter_table: Table
    limit: LimitPart | None
    outputs: Picture
    residuals: list[Picture]
    innovation_table: Table
    initial: Table
    statuses: Table
    faults: Table | None
    unsolved: Table | None


def write_run_report(results: Sequence[tuple[Scenario, Sequence[Run]]], path: Path | str, command: str = "") -> None:
    """Write the report of one or several scenarios as a single HTML file without external parts.

    Parameters
    ----------
    results
        Scenarios, each with its runs as `run_scenario` returns them.
    path
        File to write, whole or not at all.
    command
        Command line that made the runs, for the footer.
    """
    write_text(Path(path), run_report(results, command))


def run_report(results: Sequence[tuple[Scenario, Sequence[Run]]], command: str = "") -> str:
    """Return the page that `write_run_report` writes."""
    cases = series.cases(results)
    album = Album()
    closed_loops = _closed_loops(results, album)  # first, as they come first on the page and so in number
    overview = [_spread(case, album) for case in cases]
    chapters = [
        _chapter(case, f"case-{i}", album, spread)
        for i, (case, spread) in enumerate(zip(cases, overview, strict=True), 1)
    ]
    names = list(dict.fromkeys(c.scenario.name for c in cases))
    page = Page(
        title=f"Run report: {', '.join(names)}",
        lead=_lead(cases),
        contents=[
            *((c.anchor, f"Closed loop: {c.title}") for c in closed_loops),
            ("fits", "Fits"),
            *((c.anchor, c.title) for c in chapters),
        ],
        made=made_by(command, _made(cases)),
    )
    return render(
        "run.html",
        page,
        closed_loops=closed_loops,
        chapters=chapters,
        candidates=candidates(cases),
        below=[c.title for c, case in zip(chapters, cases, strict=True) if below_published(case)],
    )


def _lead(cases: Sequence[CaseRuns]) -> str:
    estimators = list(dict.fromkeys(who for case in cases for who in case.roles))
    runs = sum(len(case.runs) for case in cases)
    return f"{runs} simulated {'run' if runs == 1 else 'runs'} with the estimators {', '.join(estimators)}."


def _made(cases: Sequence[CaseRuns]) -> list[tuple[str, str]]:
    seeds = {case.scenario.path.name: seed_list(case.seeds) for case in cases}
    return [(f"Seeds of {name}", text) for name, text in seeds.items()]


def _closed_loops(results: Sequence[tuple[Scenario, Sequence[Run]]], album: Album) -> list[compare.Chapter]:
    """Controllers and estimators side by side for each scenario with economics."""
    chapters = []
    for i, (scenario, runs) in enumerate(results, 1):
        if any(run.account for run in runs):
            chapters.append(compare.compare_chapter(compare_runs(scenario, runs), f"closed-loop-{i}", album))
    return chapters


def _chapter(case: CaseRuns, anchor: str, album: Album, spread: Picture | None) -> Chapter:
    published = case.scenario.file.published
    title = f"{case.scenario.name}, controller {case.controller}" if case.several_controllers else case.scenario.name
    time_series = (
        closed_loop_sections(case, _first(case), album)
        if case.closed_loop
        else [("Inputs", [_add(album, *_inputs(case))])]
    )
    watch = watch_section(case, _first(case), album)
    parameters, outputs = (_add(album, *made) for made in (_parameters(case), _outputs(case)))
    return Chapter(
        anchor=anchor,
        title=title,
        description=case.scenario.file.description,
        source=published.source if published else "",
        fits=tables.fits_table(case),
        findings=findings(case),
        time_series=time_series,
        watch=watch,
        parameters=parameters,
        parameter_table=tables.parameter_table(case),
        limit=limit_part(case, album),
        outputs=outputs,
        residuals=_residuals(case, album),
        spread=spread,
        innovation_table=tables.innovation_table(case),
        initial=tables.initial_table(case),
        statuses=tables.status_table(case),
        faults=fault_table(case),
        unsolved=unsolved_table(case.runs),
    )


_Made = tuple[list[Panel], str, str]


def _add(album: Album, panels: list[Panel], caption: str, alt: str) -> Picture:
    return album.add(figures.time_figure(panels), caption, alt)


def _first(case: CaseRuns) -> str:
    """Say which seed a time series shows; with one seed there is nothing to tell apart."""
    return f"Seed {case.seeds[0]}, the first of {len(case.seeds)}." if len(case.seeds) > 1 else f"Seed {case.seeds[0]}."


def _inputs(case: CaseRuns) -> _Made:
    panels, still = series.input_panels(case)
    constant = f" Constant: {', '.join(still)}." if still else ""
    names = ", ".join(p.label for p in panels)
    return panels, f"{case.scenario.name}: inputs. {_first(case)}{constant}", f"Inputs over time: {names}"


def _parameters(case: CaseRuns) -> _Made:
    names = ", ".join(case.labels)
    caption = f"{case.scenario.name}: adapted parameters {names}, with the ±2σ the estimator claims. {_first(case)}"
    return series.parameter_panels(case), caption, f"Truth and estimates over time of {names}"


def _outputs(case: CaseRuns) -> _Made:
    names = ", ".join(q.name.replace("_", " ") for q in case.outputs)
    caption = (
        f"{case.scenario.name}: {names}, true and predicted before each sample is used; below, the error on its own "
        f"scale (constant parameters leave the panel where they are worse). {_first(case)}"
    )
    return series.output_panels(case), caption, f"True and predicted {names} over time, and the errors"


def _residuals(case: CaseRuns, album: Album) -> list[Picture]:
    pictures = []
    for q in case.outputs:
        rows = [series.residuals(case, run, q) for run in case.first.values()]
        name = q.name.replace("_", " ")
        caption = (
            f"{case.scenario.name}: innovations of {name} over the standard deviation the estimator expects (dashed: "
            "±2), their autocorrelation with the 95 % band of white noise, and their histogram with the standard "
            f"normal density. {_first(case)}"
        )
        pictures.append(album.add(figures.residual_figure(rows), caption, f"Innovations of {name}"))
    return pictures


def _spread(case: CaseRuns, album: Album) -> Picture | None:
    spreads = series.spreads(case)
    if not spreads:
        return None
    caption = (
        f"{case.scenario.name}: fits over {tables.seeds_text(case)}, one point a seed; box from quartile to quartile "
        "with the median, whiskers to the extremes, diamond at the published value."
    )
    return album.add(
        distributions.spread_figure(spreads, case.roles), caption, "Distribution of the fits over the seeds"
    )
