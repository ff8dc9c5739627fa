"""The report of `discover`: verdict, residual, evidence, the effect found, and the error before and after."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from adaptive_flot.charts.palette import GREY
from adaptive_flot.charts.plotdata import Chart, Role
from adaptive_flot.discovery.assessment.verification import AT_NOISE
from adaptive_flot.discovery.background.wording import estimated
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Discovery
from adaptive_flot.discovery.verdict.words.curve import effect_curves
from adaptive_flot.files import write_text
from adaptive_flot.report.discovery import tables
from adaptive_flot.report.discovery.answer import error_facts, made_from, title_of, word_in_words
from adaptive_flot.report.discovery.charts import curve_chart, score_map
from adaptive_flot.report.discovery.figures import residual_panels, run_panels
from adaptive_flot.report.discovery.test_design import experiment_chapter
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.page import Page, made_by, render
from adaptive_flot.report.kit.parts import Bullets, Fact, Heading, Part, Picture, Section, present
from adaptive_flot.report.kit.plotdata import Residuals
from adaptive_flot.report.kit.residuals import residual_pictures
from adaptive_flot.report.kit.wording import capital, spaced

MOST_RESIDUALS = 3
"""Outputs whose residuals are drawn: one that is still wrong, and those whose error fell most by their noise."""
TITLES = {
    "none": "no effect is missing",
    "named": "a missing effect, by name",
    "class": "one of a few effects is missing",
    "unnamed": "a missing effect without a name",
    "insufficient": "the record does not say enough",
    "abstain": "something is missing, and the record does not tell what",
}


def write_discovery_report(
    discovery: Discovery, name: str, path: Path | str, command: str = "", read: Sequence[Path] = ()
) -> None:
    """Write the report as a single HTML file without external parts.

    Parameters
    ----------
    discovery
        What `discover` returned.
    name
        What the record is called.
    path
        File to write, whole or not at all.
    command
        Command line that made it, for the foot.
    read
        Files whose hashes the foot shows.
    """
    write_text(Path(path), discovery_report(discovery, name, command, read))


def discovery_report(discovery: Discovery, name: str, command: str = "", read: Sequence[Path] = ()) -> str:
    """Return the page that `write_discovery_report` writes."""
    album, verdict = Album(), discovery.verdict
    first: list[Part] = []
    sections: list[Section] = []
    searched = discovery.search is not None  # nothing is searched in a record whose inputs explain nothing
    if searched and discovery.problem is not None and discovery.before is not None and discovery.after is not None:
        first, sections = _evidence(discovery, discovery.problem, discovery.before, discovery.after, album)
    data = Section("data", "Data screening", "what of the record can be used", [Bullets(_data(discovery))])
    record = discovery.screening.record
    page = Page(
        kind="Discovery report",
        title=_title(discovery),
        lead=f"Record: {name}, {len(record)} rows, one every {record.dt:g} s. Model: {discovery.model.name}.",
        answer=[spaced(verdict.reason), *(spaced(f) for f in _facts(discovery) if not _repeats(f, verdict.reason))],
        facts=[Fact("Verdict", verdict.word, word_in_words(verdict)), *error_facts(verdict.error)],
        first=first,
        sections=[*sections, data],
        made=made_by(command, made_from(discovery.model.name, verdict.seconds, [record]), read),
    )
    return render(page, album)


def _title(discovery: Discovery) -> str:
    """What is missing where it has a name, with size and time but without what stands in brackets; else the word."""
    verdict = discovery.verdict
    if verdict.word == "named" and verdict.effects:
        return re.sub(r" \([^()]*\)", "", verdict.reason.partition(". ")[0])
    return title_of(verdict, TITLES)


def _repeats(fact: str, reason: str) -> bool:
    """Whether the reason says a fact already."""
    return fact.partition(": ")[2].rstrip(".").lower() in reason.lower()


def _evidence(
    discovery: Discovery, problem: Problem, before: Fit, after: Fit, album: Album
) -> tuple[list[Part], list[Section]]:
    """What shows the answer, and the chapters behind it."""
    verdict = discovery.verdict
    errors = present(
        tables.error_table(discovery),
        _all_outputs(problem, before, after, album),
        _before_after(problem, before, after, album),
    )
    residual = present(
        tables.symptom_table(discovery),
        tables.test_table(discovery),
        *(p for j in _telling(discovery, problem) for p in _residuals(discovery, problem, j, album)),
    )
    sections = [
        Section("errors", "Error before and after", "sizes, intervals, over time", errors),
        Section("residual", "Residual", "symptoms, whiteness", residual),
        Section("evidence", "Evidence", "alternatives, what can not be told apart", _alternatives(discovery, album)),
    ]
    if verdict.experiment is not None:
        parts = experiment_chapter(verdict.experiment, discovery.model, problem.columns, album)
        sections.append(Section("experiment", "Which input moves would tell", verdict.experiment.name, parts))
    if verdict.absorbed and before is not after:
        sections.append(
            Section("absorbed", "What the adapted parameters had absorbed", "", [tables.absorbed_table(discovery)])
        )
    first = present(
        _measured_against_model(discovery, problem, before, after, album),
        *_curve_pictures(discovery, problem, after, album),
        tables.coefficient_table(discovery) if verdict.effects else None,
        tables.least_shown_table(discovery),
    )
    return first, sections


def _alternatives(discovery: Discovery, album: Album) -> list[Part]:
    return present(
        tables.place_table(discovery),
        _map(discovery, album),
        tables.alternative_table(discovery) if tables.ranked_alternatives(discovery) else None,
        Heading("What can not be told apart"),
        Bullets(tables.not_told_apart(discovery)),
    )


def _measured_against_model(discovery: Discovery, problem: Problem, before: Fit, after: Fit, album: Album) -> Picture:
    """The first chart: what was measured, and free runs of the model as it is and with what was found."""
    found = "and with what was found" if after is not before else ""
    runs = f"Measured values, and free runs of the model as it is {found}".rstrip()
    caption = f"{runs}: simulated from the inputs alone, never corrected by a measurement."
    if problem.background is not None:  # it was estimated from the measurements
        caption = f"{runs}: simulated from the inputs, with {spaced(estimated(problem.background))}."
    panels = run_panels(problem, before, after)
    shown = _telling(discovery, problem)
    if len(shown) < len(panels):
        which = "Outputs whose error changed most" if after is not before else f"{len(shown)} of the outputs"
        caption += f" {which}; all {len(panels)} are in the next chapter."
    chart = Chart(tuple(panels[j] for j in shown))
    return album.chart(chart, caption, "Measured outputs over time, and free runs of the model")


def _facts(discovery: Discovery) -> list[str]:
    said = [
        f"{tables.effect_text([(e.effect.site, e.effect.driver)])}: {e.meaning}." for e in discovery.verdict.effects
    ]
    said += [f"Drift of an adapted parameter: {d}." for d in discovery.verdict.drift]
    if discovery.search is not None and discovery.search.verification is not None:
        said.append(f"On rows that did not choose it: {discovery.search.verification}.")
    return said


def _data(discovery: Discovery) -> list[str]:
    said = [f"Insufficient: {r}." for r in discovery.screening.reasons] + [f"{n}." for n in discovery.screening.notes]
    return said or ["Every measured output and every input can be used."]


def _curve_pictures(discovery: Discovery, problem: Problem, after: Fit, album: Album) -> list[Picture]:
    best = discovery.judgement.best if discovery.judgement else None
    curves = effect_curves(problem, discovery.told or after, len(best.names)) if best else ()
    if not curves:
        return []
    told = "the effect" if discovery.verdict.effects else "the best alternative, which the verdict does not tell"
    names = capital(tables.effect_text([(c.effect.site, c.effect.driver) for c in curves]))
    caption = f"{names}: {told}, over what the record covers, with the 95 % band from the covariance of the fit."
    if any(c.effect.driver != "time" for c in curves):
        caption += " Below: how often the record was there."
    if any(c.bend_only for c in curves):
        caption += (
            " Only how it bends away from a straight line through the middle of the record is shown: a straight part "
            "is one of the adapted parameters."
        )
    if any(c.anchor is not None and not c.bend_only for c in curves):
        caption += (
            " Shown relative to the middle of the record, which is all it tells: a constant change at this site is "
            "one of the adapted parameters."
        )
    rest = "The same, over the other driver."
    return [
        album.chart(curve_chart(c), rest if k else caption, f"Curve of the effect over {spaced(c.effect.driver)}")
        for k, c in enumerate(curves)
    ]


def _before_after(problem: Problem, before: Fit, after: Fit, album: Album) -> Picture:
    panels = residual_panels(problem, before, after)
    caption = (
        "Measured minus free run, without and with the effect, but for the first rows, which are left out because the "
        "initial state is not known."
    )
    return album.chart(Chart(tuple(panels)), caption, "Residual of each output over time, before and after")


def _all_outputs(problem: Problem, before: Fit, after: Fit, album: Album) -> Picture | None:
    panels = run_panels(problem, before, after)
    if len(panels) <= MOST_RESIDUALS:
        return None
    caption = "Every measured output, and free runs of the model."
    return album.chart(Chart(tuple(panels)), caption, "Every measured output over time, and free runs of the model")


def _telling(discovery: Discovery, problem: Problem) -> list[int]:
    """Places of the output that is furthest from its noise after, if any is, and of those whose error fell most."""
    fell = {c.output: (c.before - c.after) / max(c.noise, 1e-300) for c in discovery.verdict.error}
    names = [discovery.model.outputs[c].name for c in problem.columns]
    ranked = sorted(range(len(names)), key=lambda j: -fell.get(names[j], 0.0))
    left = {c.output: c.after / max(c.noise, 1e-300) for c in discovery.verdict.error}
    worst = max(range(len(names)), key=lambda j: left.get(names[j], 0.0))
    first = [worst] if left.get(names[worst], 0.0) > AT_NOISE else []
    return [*first, *(j for j in ranked if j not in first)][:MOST_RESIDUALS]


def _residuals(discovery: Discovery, problem: Problem, j: int, album: Album) -> list[Picture]:
    q = discovery.model.outputs[problem.columns[j]]
    assert discovery.before is not None and discovery.after is not None  # called with a search at hand
    shown = slice(problem.first_row, None)
    std = discovery.after.noise.stationary_std()[j] * problem.weights[shown, j]
    rows = []
    fits = [("before", discovery.before), ("after", discovery.after)] if discovery.after is not discovery.before else []
    for k, (label, fit) in enumerate(fits or [("model as it is", discovery.before)]):
        p = discovery.verdict.tests.get(f"ljung_box_{'after' if label == 'after' else 'before'}_{q.name}", float("nan"))
        role, slot = (Role.CONSTANT, GREY) if k == 0 else (Role.ESTIMATE, 0)
        rows.append(Residuals(label, role, slot, problem.record.time[shown], fit.residual(problem)[shown, j] / std, p))
    caption = f"{capital(spaced(q.name))}: free-run residual over the standard deviation of the noise."
    return residual_pictures(rows, caption, f"Residual of {spaced(q.name)}", album)


def _map(discovery: Discovery, album: Album) -> Picture:
    assert discovery.search is not None  # called with a search at hand
    best = discovery.judgement.best if discovery.judgement else None
    names = best.names if best else ()
    caption = (
        "What each site (row) with each driver (column) would explain of the residual of the model as it is, to first "
        "order, after everything that the adapted parameters and the initial state can absorb; in percent of the best. "
        "Empty: the record tells nothing about it. Dot: known by name."
        + (" Frame: the best alternative after full fits." if names else "")
    )
    return album.heat(
        score_map(discovery.search.rounds[0].scores, names), caption, "Map of what would explain the residual"
    )
