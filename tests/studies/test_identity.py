"""A run is named by what its result depends on: that and nothing else changes the name."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml

from adaptive_flot.errors import StudyError
from adaptive_flot.resources import cell_file
from adaptive_flot.studies.grid import Grid, grid_of
from adaptive_flot.studies.manifest import remember
from adaptive_flot.studies.study_file import load_study
from tests.studies.conftest import WriteStudy


def grid(file: Path) -> Grid:
    return grid_of(load_study(file))


def test_names_are_unique_and_carry_the_seed(write_study: WriteStudy) -> None:
    runs = grid(write_study()).runs()
    assert len(set(runs)) == len(runs) == 6
    assert [r.partition("-")[2] for r in runs] == ["1", "1", "2", "2", "3", "3"]


@pytest.mark.parametrize(
    "changes",
    [{"description": "Other words"}, {"seeds": [7]}, {"published": {"source": "x", "fits": {}}}],
    ids=lambda c: next(iter(c)),
)
def test_words_do_not_change_the_names(write_study: WriteStudy, changes: dict[str, Any]) -> None:
    assert grid(write_study(scenario=changes)).runs() == grid(write_study()).runs()


def test_place_comments_and_layout_do_not_change_the_names(write_study: WriteStudy, tmp_path: Path) -> None:
    file = write_study()
    (tmp_path / "mine.py").write_text("from estimators.fixed import Fixed as Mine\n")
    write_study({"estimators": ["mine:Mine", "rpem"]})
    before = grid(file).runs()
    elsewhere = shutil.copytree(tmp_path, tmp_path / "elsewhere")
    scenario = elsewhere / "short.yaml"
    scenario.write_text("# a comment\n" + yaml.safe_dump(yaml.safe_load(scenario.read_text()), sort_keys=True))
    assert grid(elsewhere / "study.yaml").runs() == before


@pytest.mark.parametrize(
    ("study", "scenario"),
    [
        ({}, {"measurements.concentrate_grade.noise_std": 2.0e-3}),
        ({}, {"parameters.C.change": 0.1}),
        ({}, {"initial_estimate.guess": {"n": 1.0}}),
        ({}, {"plant": {"integrator": "accurate"}}),
        ({}, {"estimators.rpem.options": {"forgetting": 0.97}}),
        ({"estimators": {"rpem": {"use": "rpem", "options": {"forgetting": 0.97}}, "fixed": None}}, {}),
        ({"estimators": {"rpem": {"use": "rpem", "options": {"forgetting": 0.98}, "start": "nominal"}}}, {}),
    ],
)
def test_what_changes_results_changes_the_names(
    write_study: WriteStudy, study: dict[str, Any], scenario: dict[str, Any]
) -> None:
    before = grid(write_study())
    after = grid(write_study(study, scenario))
    name = [c.estimator for c in after.cases].index("rpem")
    assert after.cases[name].key != before.cases[0].key


def test_a_number_of_the_cell_file_changes_the_names_and_its_source_does_not(
    write_study: WriteStudy, tmp_path: Path
) -> None:
    content = yaml.safe_load(cell_file().read_text())
    own = tmp_path / "own.yaml"
    own.write_text(yaml.safe_dump(content))
    before = grid(write_study(scenario={"cell": "own.yaml"})).runs()
    entry = content["geometry"]["cross_section_area"] if "geometry" in content else next(iter(content.values()))
    entry = entry if "value" in entry else next(iter(entry.values()))
    entry["source"] = "another book"
    own.write_text(yaml.safe_dump(content))
    assert grid(write_study(scenario={"cell": "own.yaml"})).runs() == before
    entry["value"] *= 1.01
    own.write_text(yaml.safe_dump(content))
    assert grid(write_study(scenario={"cell": "own.yaml"})).runs() != before


def test_code_of_a_users_estimator_changes_its_names_only(write_study: WriteStudy, tmp_path: Path) -> None:
    code = tmp_path / "mine.py"
    code.write_text("from estimators.fixed import Fixed as Mine\n")
    file = write_study({"estimators": ["rpem", "mine:Mine"]})
    before = grid(file)
    code.write_text("from estimators.fixed import Fixed as Mine  # faster\n")
    after = grid(file)
    assert after.cases[0].key == before.cases[0].key and after.cases[1].key != before.cases[1].key


CHANGES: dict[str, tuple[dict[str, Any], dict[str, Any], str]] = {
    "scenario": ({}, {"parameters.C.change": 0.1}, "scenario 'short' .* has changed"),
    "estimator": ({}, {"estimators.rpem.options": {}}, "estimator 'rpem' .* has changed"),
    "fewer seeds": ({"seeds.count": 2}, {}, r"seeds that are no longer in the study \(3\)"),
    "fewer estimators": ({"estimators": ["fixed"]}, {}, "schedule, rpem, which is no longer in the study"),
}


@pytest.mark.parametrize(("study", "scenario", "words"), CHANGES.values(), ids=list(CHANGES))
def test_folder_refuses_a_changed_study_and_says_what_changed(
    write_study: WriteStudy, tmp_path: Path, study: dict[str, Any], scenario: dict[str, Any], words: str
) -> None:
    remember(tmp_path, grid(write_study()))
    kept = (tmp_path / "study.json").read_bytes()
    with pytest.raises(StudyError, match=words):
        remember(tmp_path, grid(write_study(study, scenario)))
    assert (tmp_path / "study.json").read_bytes() == kept
    remember(tmp_path, grid(write_study()))


def test_folder_takes_a_study_that_has_grown(write_study: WriteStudy, tmp_path: Path) -> None:
    remember(tmp_path, grid(write_study()))
    grown = grid(write_study({"seeds.count": 5, "estimators": ["rpem", "fixed", "oracle"]}))
    remember(tmp_path, grown)
    with pytest.raises(StudyError, match="no longer"):
        remember(tmp_path, grid(write_study()))


def test_options_of_the_whole_study_do_not_mix(write_study: WriteStudy, tmp_path: Path) -> None:
    study = load_study(write_study())
    remember(tmp_path, grid_of(study))
    with pytest.raises(StudyError, match="compiled = False, now it is True"):
        remember(tmp_path, grid_of(study, compiled=True))


def test_folder_with_results_of_nobody_is_refused(write_study: WriteStudy, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "runs.parquet").touch()
    with pytest.raises(StudyError, match=r"without study\.json"):
        remember(tmp_path / "out", grid(write_study()))
    (tmp_path / "out" / "study.json").write_text("{}")
    with pytest.raises(StudyError, match="not the memory of a study"):
        remember(tmp_path / "out", grid(write_study()))
