"""The pictures of a closed loop in the run report, with their captions."""

from __future__ import annotations

from adaptive_flot.report.kit import figures
from adaptive_flot.report.kit.page import Album, Picture
from adaptive_flot.report.kit.strips import strip_figure
from adaptive_flot.report.kit.style import amount
from adaptive_flot.report.run import closed_loop
from adaptive_flot.report.run.series import CaseRuns

Sections = list[tuple[str, list[Picture]]]


def closed_loop_sections(case: CaseRuns, which: str, album: Album) -> Sections:
    """Operation, plans (where the controller makes any) and statuses of the first seed; `which` names it."""
    name = f"{case.scenario.name}, {case.controller}"
    sections = [("Operation", [_operation(case, name, which, album)])]
    plans = [_plans(case, who, name, which, album) for who, run in case.first.items() if not run.plans.empty]
    if plans:
        sections.append(("Plans and what happened", plans))
    sections.append(("Statuses over time", [_strips(case, name, which, album)]))
    return sections


def _operation(case: CaseRuns, name: str, which: str, album: Album) -> Picture:
    limits = case.scenario.limits
    assert limits is not None
    panels = closed_loop.operation_panels(case)
    still = [
        f"{q.name.replace('_', ' ')} {amount(float(case.shown(run)[q.column].iloc[0]), q.unit)}"
        for q in case.scenario.model.inputs
        for run in list(case.first.values())[:1]
        if q.name.replace("_", " ") not in [p.label for p in panels]
    ]
    dotted = "; dotted: level" if any(t.role.value == "followed" for p in panels for t in p.traces) else ""
    caption = (
        f"{name}: inputs as they acted, disturbances, true grade and recovery of the plant; dashed: limits{dotted}. "
        f"{which}" + (f" Constant: {', '.join(still)}." if still else "")
    )
    return album.add(figures.time_figure(panels), caption, "Inputs, disturbances, grade and recovery over time")


def _plans(case: CaseRuns, who: str, name: str, which: str, album: Album) -> Picture:
    figure = figures.time_figure(closed_loop.plan_panels(case, case.first[who]))
    caption = (
        f"{name}, {who}: what the controller planned at a moment (dot) and what then happened; dashed: limits. Of all "
        f"plans, one at each end of the plan before is shown. {which}"
    )
    return album.add(figure, caption, f"Plans of {who} against inputs and grade that came")


def _strips(case: CaseRuns, name: str, which: str, album: Album) -> Picture:
    figure = strip_figure(closed_loop.strips(case))
    faults = "; below, when the injected faults acted" if case.scenario.file.faults else ""
    caption = (
        f"{name}: status of estimate and decision, and who decided, at each interval{faults}; short events are drawn "
        f"wider than they lasted. {which}"
    )
    return album.add(figure, caption, "Statuses and who decided over time")
