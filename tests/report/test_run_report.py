"""The page of a run: self-contained, complete, and right about the numbers it is made from."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from adaptive_flot import provenance
from adaptive_flot.charts.palette import GREY
from adaptive_flot.charts.plotdata import Role
from adaptive_flot.report.kit.parts import Table
from adaptive_flot.report.run import series
from adaptive_flot.report.run.absorbed import absorbed
from adaptive_flot.report.run.findings import below_published, candidates, findings, swing_share
from adaptive_flot.report.run.page import run_report, write_run_report
from adaptive_flot.report.run.tables import fits_table, status_table
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.scenario import Scenario
from tests.report.changed_runs import with_table

Result = tuple[Scenario, list[Run]]


@pytest.fixture(scope="module")
def result() -> Result:
    scenario = load_scenario("paper_scenario_1")
    file = scenario.file.model_copy(
        update={
            "duration_s": 360.0,
            "fits_after_s": 120.0,
            "initial_estimate": scenario.file.initial_estimate.model_copy(update={"until_s": 120.0}),
        }
    )
    short = replace(scenario, file=file)
    return short, run_scenario(short, seeds=[1, 2])


def with_fits(result: Result, estimator: str, fits: dict[str, float]) -> series.CaseRuns:
    scenario, runs = result
    changed = [replace(r, fit={**r.fit, **fits}) if r.estimator == estimator else r for r in runs]
    return series.cases([(scenario, changed)])[0]


class Links(HTMLParser):
    """Collects what a page would fetch, and the tags left open."""

    def __init__(self) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.charts = 0
        self.images = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.charts += ("type", "application/json") in attrs
        self.images += tag == "img"
        self.fetched += [v for k, v in attrs if k in ("src", "href") and v and not v.startswith(("#", "data:"))]
        assert tag != "img" or dict(attrs).get("alt"), "a picture without a text for those who do not see it"


def test_page_is_self_contained(result: Result, tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    write_run_report([result, result], path, command="adaptive-flot run x --seed 1")
    text = path.read_text(encoding="utf-8")
    links = Links()
    links.feed(text)
    assert links.fetched == []
    # a scenario: parameters, outputs, inputs, bound, two of residuals; two seeds are too few for a distribution
    assert (links.charts, links.images) == (12, 12)
    assert len(text) < 2_000_000
    assert "adaptive-flot run x --seed 1" in text
    assert "2 seeds (1, 2)" in text
    words = re.sub(r"<(script|style).*?</\1>", "", re.sub(r'src="[^"]*"', "", text), flags=re.DOTALL)
    assert "nan" not in words.lower().split()


def test_same_runs_same_page(result: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(provenance, "now", lambda: "2026-01-01 00:00 UTC")
    assert run_report([result]) == run_report([result])
    assert run_report([result, result], processes=2) == run_report([result, result])


def test_text_is_escaped(result: Result) -> None:
    assert "<b>bold</b>" not in run_report([result], command="<b>bold</b>")


def test_fits_table_holds_median_range_and_difference(result: Result) -> None:
    scenario, runs = result
    rows = {(r[0], r[1]): r for r in fits_table(series.cases([(scenario, runs)])[0]).rows}
    fits = [r.fit["n"] for r in runs if r.estimator == "rpem"]
    row = rows["rpem", "n"]
    assert row[2] == f"{np.median(fits):.2f}"
    assert row[3] == f"{min(fits):.2f} – {max(fits):.2f}"
    assert (row[4], row[5].replace("−", "-")) == ("97.99", f"{np.median(fits) - 97.99:+.2f}")
    assert rows["fixed", "n"][4:] == ("–", "–")


def test_findings_follow_the_numbers(result: Result) -> None:
    better = {"n": 99.0, "C": 99.0, "concentrate_grade": 99.0}
    good = with_fits(result, "rpem", better)
    good = replace(good, runs=tuple(replace(r, fit=better) for r in good.runs))
    assert not below_published(good)
    assert not candidates([good])
    assert not any("Below" in s for s in findings(good))
    poor = with_fits(result, "rpem", {"C": 90.0})
    assert below_published(poor)
    assert any("rpem, C: 90.00, 6.86 below 96.86" in s for s in findings(poor))
    assert any("0.995" in s and "200 s" in s for s in candidates([poor]))


def test_parameters_that_take_up_something_else_are_told(result: Result) -> None:
    """The share counts the samples of the estimator, not those of the record before it; nothing is said below 1 %."""
    _, runs = result
    before, few, many = (
        [replace(r, status_counts={"initialising": 900, "ok": 100 - n, "model_error": n}) for r in runs]
        for n in (0, 1, 25)
    )
    assert absorbed("imm", before) == []
    assert absorbed("imm", few)[0].startswith("imm: in 1% of the samples")
    assert absorbed("imm", many)[0].startswith("imm: in 25% of the samples")


def test_constant_differs_only_outside_our_range(result: Result) -> None:
    def said(value: float) -> bool:
        case = with_fits(result, "fixed", {"concentrate_grade": value})
        return any(s.startswith("Constant parameters") for s in findings(case))

    assert said(60.0)
    assert not said(75.1)


def test_not_finite_fits_are_shown_not_hidden(result: Result) -> None:
    scenario, runs = result
    broken = [replace(r, fit={**r.fit, "n": float("nan")}) if r.seed == 2 else r for r in runs]
    rows = fits_table(series.cases([(scenario, broken)])[0]).rows
    assert rows[0][3] == "–; 1 not finite"
    run_report([(scenario, broken)])


def test_report_before_the_estimator_starts(result: Result) -> None:
    """Rows without an estimate (NaN) leave gaps."""
    scenario, runs = result
    early = replace(scenario, file=scenario.file.model_copy(update={"fits_after_s": 0.0, "published": None}))
    case = series.cases([(early, runs)])[0]
    traces = series.parameter_panels(case)[0].traces
    assert any(np.isnan(t.values).any() for t in traces)
    page = run_report([(early, runs)])
    assert "Published values" not in page


def test_roles_and_swings(result: Result) -> None:
    case = series.cases([result])[0]
    assert case.roles == {"fixed": (Role.CONSTANT, GREY), "rpem": (Role.ESTIMATE, 0)}
    run = case.first["rpem"]
    table = run.table.copy()
    table["n_std"] = 0.01
    table["n_estimate"] = 1 + 0.02 * (np.arange(len(table)) % 2)
    assert swing_share(case, with_table(run, table), "n") == 1.0
    assert swing_share(case, case.first["fixed"], "n") == 0.0


def test_every_row_has_as_many_cells_as_headings(result: Result) -> None:
    case = series.cases([result])[0]
    tables: list[Table] = [fits_table(case), status_table(case)]
    assert all(len(row) == len(t.header) for t in tables for row in t.rows)


def test_closed_loop_shows_each_time_series(result: Result) -> None:
    """Where the estimator acts on the plant, inputs and truth differ and are named."""
    scenario, runs = result
    column = scenario.model.inputs[0].column
    moved = [
        with_table(r, r.table.assign(**{column: 1.1 * r.table[column]})) if r.estimator == "rpem" else r for r in runs
    ]
    panels, still = series.input_panels(series.cases([(scenario, moved)])[0])
    assert [t.label for t in panels[0].traces] == ["input (fixed)", "input (rpem)"]
    assert still == ["feed flow 1.67 × 10⁻⁴ m³/s"]
