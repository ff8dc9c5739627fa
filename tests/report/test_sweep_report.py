"""The page of a study: who is best, how surely, what failed; from a table of runs, without running any."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.report.compare.distribution import distribution_picture
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.sweep.page import sweep_report
from adaptive_flot.runner.commands.comparison import compare
from adaptive_flot.studies.study_file import Study, load_study

SEEDS = 40


def study(folder: Path, scenarios: tuple[str, ...] = ("paper_scenario_1",)) -> Study:
    file = folder / "many.yaml"
    names = ", ".join(scenarios)
    file.write_text(f"description: Many.\nscenarios: [{names}]\nestimators: [fixed, rpem]\nseeds: {{count: {SEEDS}}}\n")
    return load_study(file)


def runs(scenarios: tuple[str, ...] = ("paper_scenario_1",), failed: int = 0) -> pd.DataFrame:
    """Fits of two estimators: rpem is better with all seeds but the last four."""
    noise = np.random.default_rng(1).normal(0.0, 0.2, SEEDS)
    tables = []
    for scenario in scenarios:
        for estimator, fit in (("fixed", np.full(SEEDS, 70.0)), ("rpem", 80.0 + noise)):
            if estimator == "rpem":
                fit[-4:] = 60.0
            part = pd.DataFrame({"fit_n": fit, "fit_C": fit - 5})
            part.insert(0, "seed", np.arange(1, SEEDS + 1))
            names = {"scenario": scenario, "controller": "schedule", "estimator": estimator}
            tables.append(part.assign(**names, outcome="ok", message=""))
    table = pd.concat(tables, ignore_index=True)
    table["run"] = [f"{k:04}" for k in range(len(table))]
    table.loc[: failed - 1, ["outcome", "message"]] = ["failed", "RangeError: <b>too wide</b>"]
    table.loc[: failed - 1, ["fit_n", "fit_C"]] = np.nan
    return table


def page(folder: Path, table: pd.DataFrame, scenarios: tuple[str, ...] = ("paper_scenario_1",)) -> str:
    table.to_parquet(folder / "runs.parquet", index=False)
    return sweep_report(study(folder, scenarios), folder, "adaptive-flot sweep many.yaml")


def words(html: str) -> str:
    return " ".join(re.sub(r"<[^>]+>", " ", html).split())


def test_it_says_who_is_best_and_how_surely_before_any_table(tmp_path: Path) -> None:
    text = page(tmp_path, runs())
    top = words(text.split("<table")[0])
    assert "rpem fits best" in top and "80 runs, 40 seeds (1–40)" in top
    assert "rpem is ahead of the next best, fixed, with 36 of 40 seeds." in top
    worst_tenth = np.quantile(runs()["fit_n"].to_numpy()[SEEDS:] - 2.5, 0.1)
    assert f"nine in ten to {worst_tenth:.2f} and more" in top
    assert "none failed" in top


def test_failed_runs_are_the_first_thing_said(tmp_path: Path) -> None:
    """Their message is escaped, and the seeds are named."""
    text = page(tmp_path, runs(failed=3))
    assert "3 of 80 runs failed, 3 of them with: RangeError: &lt;b&gt;too wide" in text.split("<table")[0]
    assert "1, 2, 3" in words(text) and "<b>too" not in text


def test_a_study_of_nothing_but_failures_still_has_a_page(tmp_path: Path) -> None:
    text = words(page(tmp_path, runs(failed=80)))
    assert "All runs failed" in text and "80 of 80 runs failed" in text


def test_several_scenarios_are_one_matrix_and_one_chart(tmp_path: Path) -> None:
    both = ("paper_scenario_1", "paper_scenario_2")
    text = page(tmp_path, runs(both), both)
    assert "rpem is best in 2 of 2 scenarios" in words(text)
    first = text.split('<details class="fold"')[0]
    assert first.count("<table") == 1 and first.count("★") == 3  # in the caption too
    assert "Share of the runs" in first and first.count('class="chart"') == 1


def test_the_seeds_of_the_worst_runs_are_listed(tmp_path: Path) -> None:
    chapter = page(tmp_path, runs()).split("Worst seeds")[-1]
    rows = re.findall(r"schedule, rpem\s*</t[dh]>\s*<td[^>]*>\s*(\d+)", chapter)
    assert rows == ["37", "38", "39"]


@pytest.mark.parametrize("count", [1, 3])
def test_few_seeds_make_no_distribution(tmp_path: Path, count: int) -> None:
    few = runs().query("seed <= @count").reset_index(drop=True)
    text = page(tmp_path, few)
    assert "Share of the runs" not in text and "fits best" in text


def test_a_distribution_rises_by_one_run_at_each_value() -> None:
    """At Hazen's positions; the lowest value of many does not stretch the axis, and no value is invented."""
    (comparison,) = compare(runs().assign(result=""))
    picture = distribution_picture([comparison], album := Album())
    assert picture is not None and picture.chart is not None and album.pictures == [picture]
    panel = picture.chart.panels[0]
    assert (picture.chart.x_unit, [t.label for t in panel.traces]) == ("%", ["schedule, fixed", "schedule, rpem"])
    own = panel.traces[1]
    fits = np.sort(runs()["fit_n"].to_numpy()[SEEDS:])
    assert set(own.time) <= set(fits)
    assert np.allclose(own.values[own.time > 70], 100 * (np.arange(4, SEEDS) + 0.5) / SEEDS)
