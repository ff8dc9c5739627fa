"""`adaptive-flot sweep`: what it prints, and mistakes that end in one line and exit code 2."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
import yaml

from tests.cli.conftest import Call, WriteScenario

STUDY = "description: Two runs\nscenarios: [short.yaml]\nestimators: [fixed]\nseeds: [1, 2]\n"


@pytest.fixture
def study(scenario: WriteScenario, tmp_path: Path) -> Path:
    scenario()
    file = tmp_path / "two.yaml"
    file.write_text(STUDY)
    return file


def test_a_study_prints_its_distributions_and_goes_on_from_what_is_there(call: Call, study: Path) -> None:
    """On an embedded cluster with one process."""
    result = call("sweep", study, "--workers", "1")
    assert result.code == 0 and "Traceback" not in result.err
    text = " ".join(result.out.split())
    assert "median [5 %, 95 %]" in text and "2 runs, 0 of them from before: results/two/sweep/runs.parquet" in text
    table = pd.read_parquet("results/two/sweep/runs.parquet")
    assert f"{table['fit_C'].median():.2f} [" in text
    again = call("sweep", study)
    assert again.code == 0 and "2 of them from before" in again.out and "2 of 2 runs are there" in again.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere.yaml"], ["nowhere.yaml", "; shipped: ", "paper_1000"]),
        (["two.yaml", "--scheduler", "nonsense://x"], ["--scheduler nonsense://x", "leave the option out"]),
        (["two.yaml", "--out", "two.yaml"], ["--out: two.yaml", "is a file", "give another path"]),
    ],
)
def test_mistakes_are_one_line(call: Call, study: Path, arguments: list[str], words: list[str]) -> None:
    del study
    result = call("sweep", *arguments)
    assert result.code == 2 and result.err.count("\n") == 1 and result.out == ""
    assert all(word in result.err for word in words), result.err


def test_another_study_in_the_folder_is_one_line(call: Call, study: Path) -> None:
    call("sweep", study, "--workers", "1")
    study.write_text(yaml.safe_dump({**yaml.safe_load(STUDY), "seeds": [2, 3]}))
    result = call("sweep", study)
    assert result.code == 2 and result.err.count("\n") == 1
    assert "holds seeds that are no longer in the study (1)" in result.err and "another --out" in result.err


def test_without_a_compiler_one_line_says_so_and_the_run_goes_on(
    call: Call, study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    result = call("run", study.with_name("short.yaml"), "--estimator", "fixed", "--compile")
    assert result.code == 0 and "Report: " in result.out
    assert "--compile: no C compiler found (looked for cc, gcc, clang on the path)" in result.err
    assert result.err.count("\n") == 1
