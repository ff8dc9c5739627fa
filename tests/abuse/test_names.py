"""Names with the markup of the console, of HTML or of formulas in figures: shown as they are, everywhere."""

from __future__ import annotations

import html
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
import yaml

from adaptive_flot.console.study import print_study
from tests.cli.conftest import Call

RUN = ["[/bold]", "data[1]", "<script>", "$\\frac"]
"""Those that a whole run is tried with."""
NAMES = ["[bold]", "[/bold]", "data[1]", "[red]x[/]", "<script>", "a&b", "$\\frac", "100 %", "{0}", "__x__"]


def test_scenario_and_estimators_may_be_called_anything(
    call: Call, scenario: Callable[..., Path], tmp_path: Path
) -> None:
    """The run ends well; the console prints each name as it is, and the page escapes what HTML would take for its own.

    A slash is left out of the file's name alone, where it means a folder.
    """
    content = yaml.safe_load(scenario().read_text())
    file = tmp_path / f"{' '.join(RUN).replace('/', '')}.yaml"
    file.write_text(yaml.safe_dump({**content, "estimators": {name: {"use": "fixed"} for name in RUN}}))
    result = call("run", file, "--out", "r")
    assert result.code == 0, result.err
    page = (tmp_path / "r" / "report.html").read_text()
    for name in RUN:
        assert name in result.out
        assert html.escape(name, quote=False) in page
    assert all(word in result.out for word in file.stem.split()), "a long name is broken between words"
    assert page.count("<script") == page.count("</script>")


@pytest.mark.parametrize("name", NAMES)
def test_table_of_a_study_shows_names_as_they_are(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [{"scenario": name, "controller": name, "estimator": name, "outcome": "failed", "message": f"{name} failed"}]
    print_study(pd.DataFrame(rows))
    assert capsys.readouterr().out.count(name) == 4
