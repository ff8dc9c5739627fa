"""From runs in closed loop to what their figures draw: operation, plans against what happened, who decided."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from adaptive_flot.charts.palette import GREY
from adaptive_flot.charts.plotdata import Panel, Role, Strip, Trace
from adaptive_flot.contracts import Limits
from adaptive_flot.greybox.model import Quantity
from adaptive_flot.report.run.series import CaseRuns, changes
from adaptive_flot.runner.commands.comparison import ORACLE
from adaptive_flot.runner.commands.runs.run_result import Run

OWN = "its own controller"
"""Word for who decides as it should."""


def colours(case: CaseRuns) -> dict[str, tuple[Role, int]]:
    """A colour for each estimator, whether its estimates move or not: here it stands for a time series of the plant."""
    role = {who: Role.KNOWING if who == ORACLE else Role.ESTIMATE for who in case.first}
    return {who: (role[who], case.slots[case.controller, who]) for who in case.first}


def operation_panels(case: CaseRuns) -> list[Panel]:
    """Moved inputs with their limits (dotted: what follows a set-point), disturbances, grade and recovery."""
    limits = case.scenario.limits
    assert limits is not None  # the caller shows closed loops only
    model = case.scenario.model
    panels = [_input_panel(case, q, limits) for q in model.inputs if q.name in limits.inputs]
    panels += _disturbance_panels(case, limits)
    outputs = {q.name: q for q in model.outputs}
    panels.append(_true_output(case, outputs["concentrate_grade"], 1.3, limits.outputs["concentrate_grade"][:1]))
    panels.append(_true_output(case, outputs["recovery"], 1.0, ()))
    return panels


def _input_panel(case: CaseRuns, q: Quantity, limits: Limits) -> Panel:
    traces = list(_output_panel(case, q, 1.0).traces)
    target = q.name.removesuffix("_setpoint")
    followed = next((o for o in case.scenario.model.outputs if o.name == target != q.name), None)
    if followed is not None:
        for who, (_, j) in colours(case).items():
            table = case.shown(case.first[who])
            values = table[f"{followed.column}_true"].to_numpy()
            traces.append(Trace("", table["time_s"].to_numpy(), values, Role.FOLLOWED, j))
    return Panel(q.name.replace("_", " "), q.unit, tuple(traces), limits=limits.inputs[q.name])


def _output_panel(case: CaseRuns, q: Quantity, height: float) -> Panel:
    """An input as it acted on the plant, one line an estimator."""
    traces = []
    for who, (role, j) in colours(case).items():
        table = case.shown(case.first[who])
        traces.append(
            Trace(who, table["time_s"].to_numpy(), table[acted(table, q.column)].to_numpy(), role, j, held=True)
        )
    return Panel(q.name.replace("_", " "), q.unit, tuple(traces), height=height)


def _disturbance_panels(case: CaseRuns, limits: Limits) -> list[Panel]:
    """What moves though no controller and no estimator moves it: truth, and what is known where it is measured."""
    table = case.shown(next(iter(case.first.values())))
    disturbances = []
    for q in case.scenario.model.inputs:
        if q.name not in limits.inputs and changes(table[acted(table, q.column)].to_numpy()):
            known = q.column if acted(table, q.column) != q.column else ""
            disturbances.append((q.name, q.unit, acted(table, q.column), known))
    for p in case.scenario.model.parameters:
        if p.label not in case.labels and f"{p.label}_true" in table:
            known = f"{p.label}_known" if f"{p.label}_known" in table else ""
            disturbances.append((p.label, p.unit, f"{p.label}_true", known))
    time, panels = table["time_s"].to_numpy(), []
    for name, unit, true, known in disturbances:
        traces = [Trace("truth", time, table[true].to_numpy(), Role.TRUTH, held=True)]
        if known:
            traces.append(Trace("measured", time, table[known].to_numpy(dtype=float), Role.CONSTANT, GREY, held=True))
        panels.append(Panel(name.replace("_", " ").replace(".", " "), unit, tuple(traces), height=0.75))
    return panels


def _true_output(case: CaseRuns, q: Quantity, height: float, limits: tuple[float, ...]) -> Panel:
    return Panel(q.name.replace("_", " "), q.unit, tuple(true_traces(case, q)), height=height, limits=limits)


def true_traces(case: CaseRuns, q: Quantity, with_controller: bool = False) -> list[Trace]:
    """True values of an output, a line an estimator; named with the controller where several are shown together."""
    traces = []
    for who, (role, j) in colours(case).items():
        table = case.shown(case.first[who])
        label = f"{case.controller}, {who}" if with_controller else who
        traces.append(Trace(label, table["time_s"].to_numpy(), table[f"{q.column}_true"].to_numpy(), role, j))
    return traces


def deciders(case: CaseRuns, with_controller: bool = False) -> list[Strip]:
    """Who decided in each interval, a strip an estimator; the controller of the case is the usual one."""
    strips = []
    for who, run in case.first.items():
        table = case.shown(run)
        decided = table["decided_by"].astype(str).replace(case.controller, OWN)
        label = f"{case.controller}, {who}" if with_controller else who
        usual = OWN if (decided == OWN).any() else str(decided.mode().iloc[0])
        strips.append(Strip(label, table["time_s"].to_numpy(), decided.tolist(), usual))
    return strips


def plan_panels(case: CaseRuns, run: Run) -> list[Panel]:
    """A few plans over the inputs and the grade that came; each shown plan starts where the one before ends."""
    limits = case.scenario.limits
    assert limits is not None
    table, line = case.shown(run), colours(case)[run.estimator]
    shown = chosen_plans(run.plans[run.plans["planned_at_s"] >= table["time_s"].iloc[0]])
    panels = []
    for q in case.scenario.model.inputs:
        if q.column in run.plans:
            plans = _plan_traces(shown, q.column)
            panels.append(
                _planned_panel(table, q, acted(table, q.column), plans, limits.inputs.get(q.name, ()), line, True)
            )
    grade = next(q for q in case.scenario.model.outputs if q.name == "concentrate_grade")
    plans = _plan_traces(shown, grade.column, table.set_index("time_s")["concentrate_grade_true"])
    panels.append(
        _planned_panel(table, grade, "concentrate_grade_true", plans, limits.outputs["concentrate_grade"][:1], line)
    )
    return panels


def _planned_panel(
    table: pd.DataFrame,
    q: Quantity,
    column: str,
    plans: list[Trace],
    limits: tuple[float, ...],
    line: tuple[Role, int],
    held: bool = False,
) -> Panel:
    came = Trace("what happened", table["time_s"].to_numpy(), table[column].to_numpy(), *line, held=held)
    return Panel(q.name.replace("_", " "), q.unit, (came, *plans), height=1.2, limits=limits)


def chosen_plans(plans: pd.DataFrame) -> list[pd.DataFrame]:
    """The first plan, then each time the first one that is made when the plan before has ended.

    >>> plans = pd.DataFrame({"planned_at_s": [0, 0, 1, 1, 2, 2], "time_s": [1, 2, 2, 3, 3, 4]})
    >>> [int(p["planned_at_s"].iloc[0]) for p in chosen_plans(plans)]
    [0, 2]
    """
    chosen: list[pd.DataFrame] = []
    for at, plan in plans.groupby("planned_at_s"):
        if not chosen or at >= chosen[-1]["time_s"].iloc[-1]:
            chosen.append(plan)
    return chosen


def _plan_traces(plans: list[pd.DataFrame], column: str, came: pd.Series[float] | None = None) -> list[Trace]:
    """Each plan from the moment it was made: an input held during its moves, or an output from where it was then."""
    traces = []
    for plan in plans:
        at = float(plan["planned_at_s"].iloc[0])
        values = plan[column].to_numpy()
        start = values[0] if came is None else came.loc[:at].iloc[-1]
        time = np.r_[at, plan["time_s"].to_numpy()]
        traces.append(Trace("plan", time, np.r_[start, values], Role.PLAN, held=came is None))
    return traces


def strips(case: CaseRuns) -> list[Strip]:
    """Status of estimate and decision, who decided and injected faults, for each estimator of the first seed."""
    strip_rows = []
    for who, run in case.first.items():
        table = case.shown(run)
        time = table["time_s"].to_numpy()
        rows: Mapping[str, tuple[str, str]] = {
            "estimate": ("status", "ok"),
            "decision": ("control_status", "ok"),
            "decided by": ("decided_by", case.controller),
        }
        for label, (column, usual) in rows.items():
            usual = usual if usual in set(table[column]) else str(table[column].mode().iloc[0])
            strip_rows.append(Strip(f"{who}: {label}", time, table[column].astype(str).tolist(), usual))
    return strip_rows + _fault_strips(case.shown(next(iter(case.first.values()))))


def _fault_strips(table: pd.DataFrame) -> list[Strip]:
    """When each injected fault acted; the scenario gives the same to all estimators."""
    if "faults" not in table:
        return []
    acting = [text.split("; ") for text in table["faults"].fillna("").astype(str)]
    names = dict.fromkeys(name for active in acting for name in active if name)
    time = table["time_s"].to_numpy()
    return [
        Strip(
            name.replace("_", " "), time, ["fault" if name in active else "no fault" for active in acting], "no fault"
        )
        for name in names
    ]


def acted(table: pd.DataFrame, column: str) -> str:
    """Column of an input as it acted: `<column>_true` where that is not what was known."""
    return f"{column}_true" if f"{column}_true" in table else column
