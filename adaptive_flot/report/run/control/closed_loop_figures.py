"""The pictures of a closed loop in the run report, with their captions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.charts.plotdata import Chart, Panel
from adaptive_flot.charts.units import amount
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.parts import Picture
from adaptive_flot.report.kit.wording import spaced
from adaptive_flot.report.run.control import closed_loop
from adaptive_flot.report.run.series import CaseRuns

SELDOM = 0.001
"""Share of the intervals up to which it is not shown who else decided: the first one is always the schedule's."""


def plan_pictures(case: CaseRuns, which: str, album: Album) -> list[Picture]:
    """Plans of each estimator's controller, where it makes any, of the first seed; `which` names it."""
    name = f"{case.scenario.name}, {case.controller}"
    return [_plans(case, who, name, which, album) for who, run in case.first.items() if not run.plans.empty]


def operation_picture(case: CaseRuns, which: str, album: Album) -> Picture:
    """Operation with statuses, of the first seed; `which` names it."""
    name = f"{case.scenario.name}, {case.controller}"
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
    faults = ", and when the injected faults acted" if case.scenario.file.faults else ""
    caption = (
        f"{name}: inputs as they acted, disturbances, true grade and recovery of the plant; dashed: limits{dotted}. "
        f"Below, status of estimate and decision, and who decided, at each interval{faults}. {which}"
        + (f" Constant: {', '.join(still)}." if still else "")
    )
    chart = Chart(tuple(panels), tuple(closed_loop.strips(case)))
    return album.chart(chart, caption, "Inputs, disturbances, grade, recovery, statuses and who decided over time")


def _plans(case: CaseRuns, who: str, name: str, which: str, album: Album) -> Picture:
    chart = Chart(tuple(closed_loop.plan_panels(case, case.first[who])))
    caption = (
        f"{name}, {who}: what the controller planned at a moment, and what then happened; dashed: limits. Of all "
        f"plans, one at each end of the plan before is shown. {which}"
    )
    return album.chart(chart, caption, f"Plans of {who} against inputs and grade that came")


def contenders_picture(cases: Sequence[CaseRuns], album: Album) -> Picture:
    """Grade, recovery and who decided, of all controllers and estimators of a scenario; of the first seed."""
    scenario = cases[0].scenario
    limits = scenario.limits
    assert limits is not None  # of closed loops only
    outputs = {q.name: q for q in scenario.model.outputs}
    grade = limits.outputs["concentrate_grade"][:1]
    panels = [
        Panel(
            spaced(name),
            outputs[name].unit,
            tuple(t for case in cases for t in closed_loop.true_traces(case, outputs[name], len(cases) > 1)),
            height=1.2,
            limits=ends,
        )
        for name, ends in (("concentrate_grade", grade), ("recovery", ()))
    ]
    strips = [s for case in cases for s in closed_loop.deciders(case, len(cases) > 1)]
    strips = [s for s in strips if np.mean([state != s.usual for state in s.states]) > SELDOM]
    below = "Below, where another than the controller decided." if strips else ""
    caption = (
        f"{scenario.name}: true grade and recovery of the plant under each controller and estimator; dashed: the "
        f"lowest grade allowed. {below} Seed {cases[0].seeds[0]}."
    )
    return album.chart(Chart(tuple(panels), tuple(strips)), caption, "Grade and recovery over time, and who decided")
