"""What the run report shows of a search in the loop, and the prediction errors beside it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from adaptive_flot.discovery.results import Verdict
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.report.run.page import run_report
from adaptive_flot.runner.adaptation import supervisor
from adaptive_flot.runner.adaptation.extension import Extension
from adaptive_flot.runner.adaptation.search import Finding
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_files import plain, run_summary
from adaptive_flot.runner.results.prediction import one_move_errors, one_step_errors, rms
from adaptive_flot.runner.scenario.loading import load_scenario
from tests.runner.adaptation.test_discovery_in_the_loop import CLOSED, GROWTH, OPTIONS
from tests.runner.conftest import edited


def test_a_move_is_held_against_what_came_at_its_end() -> None:
    """By hand: two plans of two moves; of each the first counts, one that ends after the run does not."""
    table = pd.DataFrame({"time_s": [1.0, 2, 3, 4], "concentrate_grade_true": [0.20, 0.21, 0.22, 0.23]})
    table["concentrate_grade_predicted"] = table["concentrate_grade_true"] + [0.01, -0.01, 0.01, -0.01]
    plans = pd.DataFrame(
        {
            "planned_at_s": [1.0, 1, 2, 2, 4, 4],
            "time_s": [2.0, 3, 3, 4, 5, 6],
            "concentrate_grade": [0.215, 0.5, 0.21, 0.5, 0.5, 0.5],
        }
    )
    found = one_move_errors(table, plans)
    assert found["time_s"].tolist() == [2.0, 3.0]
    np.testing.assert_allclose(found["error"], [0.005, -0.01])
    assert one_move_errors(table, pd.DataFrame()).empty
    assert rms(one_step_errors(table, "concentrate_grade")) == pytest.approx(0.01)
    assert np.isnan(rms(np.full(2, np.nan)))


def test_the_report_and_the_summary_tell_what_came_of_an_alarm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Alarm, record, verdict, extension and errors, and a picture; a run that nobody watched says nothing of it."""
    growth = Effect("bubble_size", "air_flow", "power", {"exponent": 0.6}, {"reference": 1.5e-3})
    finding = Finding(Verdict("named", "stub"), Extension((growth,)))
    monkeypatch.setattr(supervisor, "search_record", lambda setup, record, processes: finding)
    changes = {**CLOSED, "seeds": [1], "plant": {"effects": [GROWTH]}, "parameters": {}}
    watch = {"discovery": {**OPTIONS, "estimators": ["fixed"]}}
    (tmp_path / "short.yaml").write_text(yaml.safe_dump(edited({**changes, **watch})))
    scenario = load_scenario(tmp_path / "short.yaml")
    runs = run_scenario(scenario)
    watched, unwatched = (run_summary(scenario, [run])["runs"][0] for run in runs)
    assert "discovery" not in unwatched
    (entry,) = plain(watched["discovery"])
    assert entry["extended"] and entry["verdict"]["verdict"] == "named" and entry["record_s"] == [1.0, 90.0]
    page = run_report([(scenario, runs)])
    section = page.split("<h2>Effects that the model lacks</h2>")[1].split("</details>")[0]
    top = page.split('<details class="fold"')[0]
    assert "the search named nothing (verdict named); the model in use was extended" in top
    assert (
        "from 1 to 90 s was searched" in section
        and "was extended" in section
        and "<figure" in section
        and "n off by" in section
    )
    assert "Effects that the model lacks" not in run_report([(scenario, [runs[1]])])
