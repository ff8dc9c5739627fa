"""The page, tables and sentences of a comparison: right about the numbers they are made from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.report.compare.findings import findings
from adaptive_flot.report.compare.page import compare_report
from adaptive_flot.report.compare.tables import compare_tables, markdown, overview_table, quantile_table
from adaptive_flot.report.kit.parts import Table
from adaptive_flot.runner.commands.comparison import Comparison, compare
from benchmarks.pictures.readme_table import BEGIN, END, PAGE, put
from tests.report.test_run_report import Links

VALUES = {("mpc", "rpem"): 11.5, ("mpc", "fixed"): 10.0, ("mpc", "oracle"): 12.0, ("pi", "fixed"): 9.0}


def comparison(seeds: int = 3, below: float = 0.0, gain: float = 1.0) -> Comparison:
    """Contenders whose value differs from seed to seed by 0.01; all but the PI keep the limit for below = 0."""
    rows = []
    for (controller, estimator), value in VALUES.items():
        for seed in range(1, seeds + 1):
            rows.append(
                {
                    "scenario": "drift",
                    "conditions": "abc",
                    "result": "r",
                    "controller": controller,
                    "estimator": estimator,
                    "seed": seed,
                    "grade_limit": 0.2,
                    "seconds": 1.0,
                    "recovery": 0.8 + 0.001 * seed,
                    "mean_grade": 0.21,
                    "below_limit": 0.3 if controller == "pi" else below,
                    "mean_depth": 0.004,
                    "value_cu_h": 10.0 + gain * (value - 10.0) + 0.01 * seed,
                    "value_metal_cu_h": 12.0,
                    "value_air_cu_h": -1.0,
                    "fit_n": 97.0,
                    "solves": 0 if controller == "pi" else 110,
                    "solve_median_s": np.nan if controller == "pi" else 0.0351,
                    "solve_p99_s": np.nan if controller == "pi" else 0.0702,
                    "control_ok": 110,
                    "control_retried": 2,
                    "status_ok": 3300,
                    "decided_mpc": 3300,
                }
            )
    (found,) = compare(pd.DataFrame(rows))
    return found


def column(table: Table, heading: str) -> list[str]:
    return [row[table.header.index(heading)] for row in table.rows]


def test_tables_hold_medians_and_ranges_in_the_units_of_their_headings() -> None:
    outcome, value, fits, statuses, times = compare_tables(comparison())
    assert column(outcome, "Value [cu/h]")[0] == "11.520\n11.510 – 11.530"
    assert column(outcome, "Share of oracle's gain [%]") == ["75.0", "0.0", "100.0", "–"]
    assert column(outcome, "Below limit [% of time]") == ["0.0", "0.0", "0.0", "30.0"]
    assert column(value, "Air [cu/h]")[0] == "−1.000"
    assert column(times, "Solve, median [ms]") == ["35.1", "35.1", "35.1", "–"]
    assert column(times, "Solve, p99 [ms]")[0] == "70.2"
    assert column(statuses, "Decisions")[0] == "ok 330\nretried 6"
    assert column(fits, "n [%]") == ["97.00"] * 4
    for table in (outcome, value, statuses, times, fits):
        assert all(len(row) == len(table.header) for row in table.rows)


def test_the_overview_joins_scenarios_and_keeps_columns_in_their_place() -> None:
    """One scenario has an oracle and so a share, the other has none: its cell is a dash, not the next column's."""
    first, second = comparison(), replace(comparison(), scenario="feed")
    second = replace(second, contenders=tuple(c for c in second.contenders if c.estimator != "oracle"))
    assert overview_table([first]) is None
    table = overview_table([first, second])
    assert table is not None
    assert [row[0] for row in table.rows] == ["drift"] * 4 + ["feed"] * 3
    assert column(table, "Share of oracle's gain [%]") == ["75.0", "0.0", "100.0", "–", "–", "–", "–"]
    assert column(table, "Below limit [% of time]")[3::3] == ["30.0", "30.0"]


def test_the_table_of_the_readme_is_replaced_between_its_marks() -> None:
    text = f"before\n{BEGIN}\nold\n{END}\nafter\n"
    assert put(text, "| new |") == f"before\n{BEGIN}\n\n| new |\n\n{END}\nafter\n"
    assert BEGIN in PAGE.read_text() and END in PAGE.read_text()


def test_markdown_is_a_table_a_renderer_takes() -> None:
    lines = markdown(compare_tables(comparison())[0]).splitlines()
    assert lines[2].startswith("| Controller | Estimator |") and lines[3].startswith("|---|---|---:")
    assert len({line.count("|") for line in lines[2:]}) == 1
    assert "| 11.520 [11.510 – 11.530] |" in lines[4]


def test_findings_say_how_much_of_the_gain_is_recaptured_and_who_breaks_the_limit() -> None:
    said = findings(comparison())
    assert any("earns +2.000 cu/h" in s and "rpem recaptures 75.0 % [75.0, 75.0]" in s for s in said)
    assert any("pi, fixed 30.0 %" in s and "mpc" not in s for s in said)
    assert any("Highest value" in s and "mpc, rpem, 11.520 cu/h (with the true parameters: 12.020)" in s for s in said)


def test_findings_give_no_share_where_the_oracle_gains_nothing() -> None:
    """Fixed parameters can earn more by breaking the limit; a share of that would be nonsense."""
    said = " ".join(findings(comparison(below=0.02, gain=-0.01)))
    assert "no gain to take a share of: fixed parameters spend 2.0 % of the time" in said
    assert "recaptures" not in said and "Highest value" not in said


@pytest.mark.parametrize("seeds", [1, 3, 8])
def test_page_is_self_contained_and_complete(seeds: int) -> None:
    page = compare_report([comparison(seeds)], command="adaptive-flot compare r")
    links = Links()
    links.feed(page)
    distribution = int(seeds >= 5)  # a chart, with a picture for readers without scripts
    assert (links.fetched, links.charts, links.images) == ([], distribution, 2 + distribution)
    for text in ("mpc", "oracle", "Share of oracle", "adaptive-flot compare r"):
        assert text in page
    assert ("box from quartile" in page) == (seeds >= 5)


def test_a_page_of_open_loop_runs_shows_their_fits() -> None:
    table = pd.DataFrame(
        [
            {"scenario": "s", "controller": "schedule", "estimator": e, "seed": k, "fit_n": 90.0 + k, "result": "r"}
            for e in ("fixed", "rpem")
            for k in range(6)
        ]
    )
    page = compare_report(compare(table))
    assert "fit of the estimates" in page and "Value [cu/h]" not in page


def test_many_seeds_show_their_distribution_and_few_only_median_and_range() -> None:
    """Values of seed k lie 0.01 k above the first, so the quantile q of 101 seeds is that of seed 1 + 100 q."""
    assert quantile_table(comparison(seeds=3)) is None
    table = quantile_table(comparison(seeds=101))
    assert table is not None
    rows = {row[: table.words]: row[table.words :] for row in table.rows}
    assert rows["Value [cu/h]", "mpc", "rpem"] == (
        "101",
        "11.510",
        "11.560",
        "11.760",
        "12.010",
        "12.260",
        "12.460",
        "12.510",
    )
    assert rows["Recovery [–]", "pi", "fixed"][:2] == ("101", "0.8010")
    assert len(rows) == 4 * 3  # value, recovery and one fit
