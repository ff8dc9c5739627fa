"""What the run report shows of a closed loop: plans against what came, limits, statuses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.charts.plotdata import Chart, Role, Strip
from adaptive_flot.greybox.data.tables import read_table
from adaptive_flot.report.kit.figures import chart_figure, time_figure
from adaptive_flot.report.run import series
from adaptive_flot.report.run.control import closed_loop
from adaptive_flot.report.run.page import run_report
from adaptive_flot.report.run.series import CaseRuns
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_files import write_runs
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.scenario import Scenario
from tests.report.changed_runs import with_table
from tests.report.test_run_report import Links

Result = tuple[Scenario, list[Run]]


@pytest.fixture(scope="module")
def result() -> Result:
    """Two minutes of the economic MPC with RPEM, a short horizon."""
    scenario = load_scenario("closed_loop_drift")
    mpc = scenario.file.controllers["economic_mpc"].model_copy(update={"options": {"solver": "fatrop", "horizon": 3}})
    update = {"duration_s": 420.0, "controllers": {**scenario.file.controllers, "economic_mpc": mpc}}
    short = replace(scenario, file=scenario.file.model_copy(update=update))
    return short, run_scenario(short, ["rpem"], [3])


@pytest.fixture(scope="module")
def case(result: Result) -> CaseRuns:
    return series.cases([result])[0]


def test_the_first_planned_move_is_what_was_applied(result: Result) -> None:
    """Time convention of the plans: a move is held during the interval that ends at its time."""
    (run,) = result[1]
    assert run.plans["planned_at_s"].unique().tolist() == [301.0, 331.0, 361.0, 391.0]
    held = run.table.set_index("time_s")
    for at in (301.0, 331.0, 361.0, 391.0):
        plan = run.plans[run.plans["planned_at_s"] == at]
        first = plan.iloc[0]
        assert plan["time_s"].tolist() == [at + 30.0, at + 60.0, at + 90.0]
        during = held.loc[at + 1 : min(first["time_s"], 420.0)]
        for column in ("air_flow_m3_s", "level_setpoint_m"):
            np.testing.assert_allclose(during[column], first[column], rtol=1e-9)


def test_the_grade_planned_for_the_next_move_is_what_comes(result: Result) -> None:
    """At the start the estimate is close and nothing drifts, so one move ahead plan and plant agree."""
    (run,) = result[1]
    came = run.table.set_index("time_s")["concentrate_grade_true"]
    first = run.plans.groupby("planned_at_s").first().iloc[:3]
    np.testing.assert_allclose(came[first["time_s"]], first["concentrate_grade"], atol=2e-3)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_plans_lie_beside_the_time_series(result: Result, tmp_path: Path, suffix: str) -> None:
    (run,) = result[1]
    write_runs([run], tmp_path, suffix)
    back = read_table(tmp_path / f"rpem_economic_mpc_seed3_plans{suffix}")
    np.testing.assert_allclose(back["concentrate_grade"], run.plans["concentrate_grade"], rtol=1e-11)


def test_plans_are_shown_one_after_the_other_from_the_truth_on(case: CaseRuns) -> None:
    air, level, grade = closed_loop.plan_panels(case, case.first["rpem"])
    plans = [t for t in grade.traces if t.role is Role.PLAN]
    assert [t.time[0] for t in plans] == [301.0, 391.0]
    came = case.first["rpem"].table.set_index("time_s")["concentrate_grade_true"]
    assert [t.values[0] for t in plans] == [came[301.0], came[391.0]]
    assert (air.limits, level.limits, grade.limits) == ((9.05e-4, 2.17e-3), (0.33, 0.42), (0.20,))


def test_a_plan_beyond_the_end_does_not_stretch_the_axis(case: CaseRuns) -> None:
    figure = time_figure(closed_loop.plan_panels(case, case.first["rpem"]))
    assert figure.axes[-1].get_xlim() == (300.0, 420.0)


def test_limits_are_drawn_and_within_the_axis(case: CaseRuns) -> None:
    air = time_figure(closed_loop.operation_panels(case)).axes[0]
    drawn = sorted(float(np.asarray(line.get_ydata())[0]) for line in air.lines if line.get_label() == "limit")
    assert drawn == pytest.approx([0.905, 2.17])
    low, high = air.get_ylim()
    assert low < 0.905 and high > 2.17


def test_disturbances_are_shown_with_what_is_known_of_them(result: Result) -> None:
    """A feed flow and a feed grade that move: truth and measurement; a constant one has no panel."""
    scenario, (run,) = result
    assert "feed flow" not in [p.label for p in closed_loop.operation_panels(series.cases([result])[0])]
    feed = 1.67e-4 * np.where(run.table["time_s"] > 350, 1.2, 1.0)
    label = "feed_concentration.chalcopyrite"
    table = run.table.copy()
    table["feed_flow_m3_s_true"], table[f"{label}_true"], table[f"{label}_known"] = feed, 10.6, 10.5
    panels = closed_loop.operation_panels(series.cases([(scenario, [with_table(run, table)])])[0])
    shown = {p.label: [t.label for t in p.traces] for p in panels}
    assert shown["feed flow"] == ["truth", "measured"]
    assert shown["feed concentration chalcopyrite"] == ["truth", "measured"]


def test_page_of_a_closed_loop(result: Result) -> None:
    page = run_report([result])
    links = Links()
    links.feed(page)
    # contenders, operation, plans, outputs, parameters, bound, two of residuals; plane and spread of the comparison
    assert (links.fetched, links.charts, links.images) == ([], 8, 10)
    for text in ("who decided", "Below limit [% of time]", "Value [cu/h]", "ok 4"):
        assert text in page


STRIP = Strip("s", np.arange(1.0, 7.0), ["ok", "ok", "held", "ok", "ok", "missing"], "ok")


def test_spells_cover_the_time_without_gap() -> None:
    found = STRIP.spells()
    assert found == [("ok", 0.0, 2.0), ("held", 2.0, 3.0), ("ok", 3.0, 5.0), ("missing", 5.0, 6.0)]


def test_a_second_in_a_day_is_still_seen() -> None:
    states = ["ok"] * 86400
    states[4000] = "held"
    figure = chart_figure(Chart(strips=(Strip("s", np.arange(1.0, 86401.0), states, "ok"),)))
    ax = figure.axes[0]
    widths = [path.get_extents().width for c in ax.collections for path in c.get_paths()]
    drawn = sorted(w for w in widths if w > 0)  # those of no width are entries of the legend
    assert len(drawn) == 3 and drawn[0] > 0.003 * 24, "the axis of a day is in hours"
    assert [t.get_text() for t in figure.legends[0].get_texts()] == ["ok", "held"]


def test_no_plans_no_table(result: Result) -> None:
    scenario, _ = result
    (run,) = run_scenario(replace(scenario, file=scenario.file.model_copy(update={"cases": scenario.file.cases[-1:]})))
    assert run.controller == "hold" and run.plans.empty and isinstance(run.plans, pd.DataFrame)


def test_each_fault_has_a_strip_of_when_it_acted(result: Result) -> None:
    scenario, (run,) = result
    table = run.table.assign(
        faults=["stuck air_flow; nan_state" if 350 < t <= 360 else "" for t in run.table["time_s"]]
    )
    table.loc[table["time_s"] > 400, "faults"] = "nan_state"
    found = {s.label: s for s in closed_loop.strips(series.cases([(scenario, [with_table(run, table)])])[0])}
    assert found["stuck air flow"].spells()[1:] == [("fault", 350.0, 360.0), ("no fault", 360.0, 420.0)]
    assert [state for state, *_ in found["nan state"].spells()] == ["no fault", "fault", "no fault", "fault"]
