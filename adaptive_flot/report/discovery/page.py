"""The report of `discover`: verdict, residual, evidence, the effect found, and the error before and after."""

from __future__ import annotations

from pathlib import Path

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Discovery
from adaptive_flot.discovery.verdict.curve import effect_curves
from adaptive_flot.files import write_text
from adaptive_flot.report.discovery import tables
from adaptive_flot.report.discovery.figures import curve_figure, heat_map, residual_panels
from adaptive_flot.report.discovery.test_design import experiment_chapter
from adaptive_flot.report.kit import figures
from adaptive_flot.report.kit.page import Album, Page, Picture, made_by, render
from adaptive_flot.report.kit.plotdata import Residuals, Role

MOST_RESIDUALS = 3
"""Outputs whose residuals are drawn: those whose error fell most, in units of their noise."""
TITLES = {
    "none": "no effect is missing",
    "named": "a missing effect, by name",
    "class": "one of a few effects is missing",
    "unnamed": "a missing effect without a name",
    "insufficient": "the record does not say enough",
    "abstain": "something is missing, but not told what",
}


def write_discovery_report(discovery: Discovery, name: str, path: Path | str, command: str = "") -> None:
    """Write the report as a single HTML file without external parts.

    Parameters
    ----------
    found
        What `discover` returned.
    name
        What the record is called.
    path
        File to write, whole or not at all.
    command
        Command line that made it, for the footer.
    """
    write_text(Path(path), discovery_report(discovery, name, command))


def discovery_report(discovery: Discovery, name: str, command: str = "") -> str:
    """Return the page that `write_discovery_report` writes."""
    album = Album()
    content: dict[str, object] = {
        "word": discovery.verdict.word,
        "reason": discovery.verdict.reason,
        "facts": [],
        "coefficients": None,
    }
    content |= {"curve": None, "errors": None, "experiment": None, "absorbed": None, "data": _data(discovery)}
    contents = [("verdict", "Verdict")]
    searched = discovery.search is not None  # nothing is searched in a record whose inputs explain nothing
    if searched and discovery.problem is not None and discovery.before is not None and discovery.after is not None:
        content |= _evidence(discovery, discovery.problem, discovery.before, discovery.after, album)
        contents += [("errors", "Error before and after"), ("residual", "Residual"), ("evidence", "Evidence")]
        contents += [("experiment", "Which input moves would tell")] if content["experiment"] else []
        contents += [("absorbed", "Absorbed")] if content["absorbed"] else []
    made = made_by(command, [("Model", discovery.model.name), ("Time", f"{discovery.verdict.seconds:.1f} s")])
    lead = f"Record: {name}, {len(discovery.screening.record)} rows, one every {discovery.screening.record.dt:g} s."
    title = f"Discovery report: {TITLES[discovery.verdict.word]}"
    page = Page(title, lead, [*contents, ("data", "Data screening")], made)
    return render("discovery.html", page, **content)


def _evidence(discovery: Discovery, problem: Problem, before: Fit, after: Fit, album: Album) -> dict[str, object]:
    verdict = discovery.verdict
    curve = _curve_picture(discovery, problem, after, album)
    columns = _telling(discovery, problem)
    planned = verdict.experiment
    return {
        "facts": _facts(discovery),
        "coefficients": tables.coefficient_table(discovery) if verdict.effects else None,
        "curve": curve,
        "errors": tables.error_table(discovery),
        "before_after": [_before_after(problem, before, after, album)],
        "tests": tables.test_table(discovery),
        "symptoms": tables.symptom_table(discovery),
        "places": tables.place_table(discovery),
        "residuals": [_residuals(discovery, problem, j, album) for j in columns],
        "map": _map(discovery, album),
        "alternatives": tables.alternative_table(discovery) if tables.ranked_alternatives(discovery) else None,
        "open": tables.not_told_apart(discovery),
        "experiment": experiment_chapter(planned, discovery.model, problem.columns, album) if planned else None,
        "absorbed": tables.absorbed_table(discovery)
        if verdict.absorbed and discovery.before is not discovery.after
        else None,
    }


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


def _curve_picture(discovery: Discovery, problem: Problem, after: Fit, album: Album) -> Picture | None:
    best = discovery.judgement.best if discovery.judgement else None
    curves = effect_curves(problem, after, len(best.names)) if best else ()
    if not curves:
        return None
    told = "the effect" if discovery.verdict.effects else "the best alternative, which the verdict does not tell"
    caption = (
        f"{tables.effect_text([(c.effect.site, c.effect.driver) for c in curves])}: {told}, over what the record "
        "covers, with the 95 % band from the covariance of the fit. Below: how often the record was there."
    )
    if any(c.anchor is not None for c in curves):
        caption += (
            " Shown relative to the middle of the record, which is all it tells: a constant change at this site is "
            "one of the adapted parameters."
        )
    return album.add(curve_figure(curves), caption, "Curve of the effect over its driver")


def _before_after(problem: Problem, before: Fit, after: Fit, album: Album) -> Picture:
    panels = residual_panels(problem, before, after)
    caption = (
        "Measured minus free run, without and with the effect, but for the first rows, which are left out because the "
        "initial state is not known."
    )
    return album.add(figures.time_figure(panels), caption, "Residual of each output over time, before and after")


def _telling(discovery: Discovery, problem: Problem) -> list[int]:
    """Places of the outputs whose error fell most, in units of their noise."""
    fell = {c.output: (c.before - c.after) / max(c.noise, 1e-300) for c in discovery.verdict.error}
    names = [discovery.model.outputs[c].name for c in problem.columns]
    ranked = sorted(range(len(names)), key=lambda j: -fell.get(names[j], 0.0))
    return ranked[:MOST_RESIDUALS]


def _residuals(discovery: Discovery, problem: Problem, j: int, album: Album) -> Picture:
    q = discovery.model.outputs[problem.columns[j]]
    assert discovery.before is not None and discovery.after is not None  # called with a search at hand
    shown = slice(problem.first_row, None)
    std = discovery.after.noise.stationary_std()[j] * problem.weights[shown, j]
    rows = []
    fits = [("before", discovery.before), ("after", discovery.after)] if discovery.after is not discovery.before else []
    for k, (label, fit) in enumerate(fits or [("model as it is", discovery.before)]):
        p = discovery.verdict.tests.get(f"ljung_box_{'after' if label == 'after' else 'before'}_{q.name}", float("nan"))
        role = Role.CONSTANT if k == 0 else Role.ESTIMATE
        rows.append(Residuals(label, role, 0, problem.record.time[shown], fit.residual(problem)[shown, j] / std, p))
    caption = (
        f"{tables.words(q.name)}: free-run residual over the standard deviation of the noise, its autocorrelation with "
        "the band of white noise, and its histogram."
    )
    return album.add(figures.residual_figure(rows), caption, f"Residual of {tables.words(q.name)}")


def _map(discovery: Discovery, album: Album) -> Picture:
    assert discovery.search is not None  # called with a search at hand
    best = discovery.judgement.best if discovery.judgement else None
    names = best.names if best else ()
    caption = (
        "What each site (row) with each driver (column) would explain of the residual of the model as it is, to first "
        "order, after everything that the adapted parameters and the initial state can absorb; as a share of the best. "
        "White: the record tells nothing about it. Dot: known by name."
        + (" Frame: the best alternative after full fits." if names else "")
    )
    return album.add(
        heat_map(discovery.search.rounds[0].scores, names), caption, "Map of what would explain the residual"
    )
