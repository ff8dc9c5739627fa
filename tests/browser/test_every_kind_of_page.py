"""Kinds of pages that no journey opens: a closed loop, an estimate, and a record of a hundred thousand rows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from adaptive_flot.charts.plotdata import Chart, Panel, Role, Trace
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.page import Page, made_by, render
from adaptive_flot.report.run.page import write_run_report
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.scenario.loading import load_scenario
from tests.browser.conftest import Check
from tests.cli.conftest import Call, WriteTable, plant, table  # noqa: F401  # fixtures
from tests.report import test_sweep_report as sweep


def test_page_of_a_closed_loop(tmp_path: Path, right: Check) -> None:
    """Two controllers: money, recovery, limit and who decided stand before the first fold."""
    scenario = load_scenario("closed_loop_drift")
    mpc = scenario.file.controllers["economic_mpc"].model_copy(update={"options": {"solver": "fatrop", "horizon": 3}})
    update = {"duration_s": 400.0, "controllers": {**scenario.file.controllers, "economic_mpc": mpc}}
    short = replace(scenario, file=scenario.file.model_copy(update=update))
    runs = run_scenario(short, ["fixed"], [3], controllers=["economic_mpc", "hold"])
    write_run_report([(short, runs)], tmp_path / "report.html", command="adaptive-flot run x")
    top = (tmp_path / "report.html").read_text().split('<details class="fold"')[0]
    for text in ("Value [cu/h]", "Recovery [%]", "Below limit [% of time]", "Decided by", "Figure 1"):
        assert text in top
    right(tmp_path / "report.html")


def test_page_of_an_estimate(call: Call, table: WriteTable, tmp_path: Path, right: Check) -> None:  # noqa: F811
    """The first chart is measured against model."""
    result = call("estimate", table(), "--out", "r", "--estimator", "fixed", "--estimator", "pem")
    assert result.code == 0, result.err
    page = (tmp_path / "r" / "report.html").read_text()
    assert "measured values, and free runs of the model" in page.split("Figure 1.")[1].split("</figcaption>")[0]
    right(tmp_path / "r" / "report.html")


def test_a_long_record_makes_a_small_page(tmp_path: Path, right: Check) -> None:
    """Eight quantities over 100 000 rows: no page is larger than 2 MB, and it is right at every width."""
    album, time = Album(), np.arange(100_000.0)
    noise = np.random.default_rng(1).standard_normal((8, len(time)))
    panels = tuple(Panel(f"q{i}", "m3/s", (Trace("", time, 1e-4 * y, Role.ESTIMATE),)) for i, y in enumerate(noise))
    chart = album.chart(Chart(panels), "Eight quantities.", "Eight quantities over time")
    made = Page("Test", "A long record", "", ["An answer."], [], [chart], [], made_by(""))
    (tmp_path / "page.html").write_text(render(made, album), encoding="utf-8")
    right(tmp_path / "page.html")


def test_page_of_draws(call: Call, table: WriteTable, tmp_path: Path, right: Check) -> None:  # noqa: F811
    """Bands of grade and recovery before the first fold, and which constant makes them wide."""
    (tmp_path / "ranges.yaml").write_text("uncertain:\n  floatability: {share: 0.1}\n  n: {share: 0.02}\n")
    inputs = table(lambda t: t[["time_s", "air_flow_m3_s", "feed_flow_m3_s", "level_setpoint_m"]])
    options = ["--draws", 64, "--out", "bands.csv", "--report", "page.html"]
    result = call("simulate", inputs, "--cell", "ranges.yaml", *options)
    assert result.code == 0, result.err
    top = (tmp_path / "page.html").read_text().split('<details class="fold"')[0]
    assert "Shares in its variance" in top and "Figure 1" in top
    right(tmp_path / "page.html")


def test_page_of_a_study(tmp_path: Path, right: Check) -> None:
    """Distributions are drawn over fits, and not over time; a line of equal values is seen."""
    page = sweep.page(tmp_path, sweep.runs(failed=2))
    assert "Share of the runs that stay below" in page.split('<details class="fold"')[0]
    (tmp_path / "report.html").write_text(page, encoding="utf-8")
    right(tmp_path / "report.html")
