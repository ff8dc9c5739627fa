"""A journey: the paper's first scenario, shortened, run over five seeds, and the page read."""

from __future__ import annotations

from pathlib import Path

import yaml

from adaptive_flot.resources import scenario_folder
from tests.browser.conftest import Check
from tests.cli.conftest import Call


def test_from_the_paper_to_its_fits(call: Call, tmp_path: Path, right: Check) -> None:
    content = yaml.safe_load((scenario_folder() / "paper_scenario_1.yaml").read_text(encoding="utf-8"))
    content |= {"duration_s": 360, "fits_after_s": 120, "seeds": [1, 2, 3, 4, 5]}
    content["initial_estimate"]["until_s"] = 120
    (tmp_path / "paper.yaml").write_text(yaml.safe_dump(content))
    done = call("run", "paper.yaml", "--out", "r")
    assert done.code == 0, done.err
    page = (tmp_path / "r" / "report.html").read_text()
    assert "published fits are reached" in page and "Figure 1" in page
    right(tmp_path / "r" / "report.html")
