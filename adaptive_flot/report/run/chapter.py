"""What the page tells of one scenario and controller, topic by topic."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from adaptive_flot.report.kit import distributions
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.parts import Bullets, Part, Picture, present
from adaptive_flot.report.run import pictures, series, tables
from adaptive_flot.report.run.control.closed_loop_figures import operation_picture, plan_pictures
from adaptive_flot.report.run.control.softened import softened_table
from adaptive_flot.report.run.control.unsolved import unsolved_table
from adaptive_flot.report.run.cramer_rao_limit import limit_part
from adaptive_flot.report.run.fault_table import fault_table
from adaptive_flot.report.run.inquiries import watch_section
from adaptive_flot.report.run.series import CaseRuns


@dataclass(frozen=True)
class Topic:
    """Title, what is inside in a few words, and the parts."""

    title: str
    inside: str
    parts: Sequence[Part]


def title(case: CaseRuns, several_scenarios: bool = True) -> str:
    """Name of a case among others."""
    name = case.scenario.name
    if not several_scenarios:
        return f"Controller {case.controller}"
    return f"{name}, controller {case.controller}" if case.several_controllers else name


def topics(case: CaseRuns, album: Album) -> list[Topic]:
    """All topics of a case that hold something."""
    which = pictures.first_seed(case)
    found = []
    if case.closed_loop:
        found.append(Topic("Operation", "inputs, limits, who decided", [operation_picture(case, which, album)]))
        if plans := plan_pictures(case, which, album):
            found.append(Topic("Plans", "what the controller expected, and what came", plans))
    watch = watch_section(case, which, album)
    if watch is not None:
        parts = present(Bullets(watch.inquiries), watch.picture, watch.predictions)
        found.append(Topic("Effects that the model lacks", "what was searched for in the loop", parts))
    measured = [pictures.output_picture(case, album)]
    if not case.closed_loop:
        measured.append(pictures.input_picture(case, album))
    found.append(Topic("Measured against model", "outputs, true and predicted", measured))
    parameters: list[Part] = [tables.parameter_table(case), tables.initial_table(case)]
    if case.closed_loop:
        parameters.insert(0, pictures.parameter_picture(case, album))
    found.append(Topic("Parameters", "errors, claimed and true; initial estimate", parameters))
    limit = limit_part(case, album)
    if limit is not None:
        found.append(
            Topic("What can be known", "Cramér–Rao bound", [limit.picture, limit.table, Bullets(limit.sentences)])
        )
    found.append(Topic("Residuals", "whiteness", [*pictures.residuals_of(case, album), tables.innovation_table(case)]))
    softened = softened_table(case.scenario.model, case.runs)
    statuses = present(tables.status_table(case), fault_table(case), unsolved_table(case.runs), softened)
    found.append(Topic("Statuses", "and times, faults, failed optimisations", statuses))
    return found


def spread_picture(case: CaseRuns, album: Album) -> Picture | None:
    """Fits over the seeds; None with too few of them."""
    spreads = series.spreads(case)
    if not spreads:
        return None
    caption = (
        f"{case.scenario.name}: fits over {tables.seeds_text(case)}, one point a seed; box from quartile to quartile "
        "with the median, whiskers to the extremes, diamond at the published value."
    )
    figure = distributions.spread_figure(spreads, case.roles)
    return album.add(figure, caption, "Distribution of the fits over the seeds")
