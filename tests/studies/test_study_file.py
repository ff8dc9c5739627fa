"""Study files: what is read is what was written, and every mistake is one line with the file and the key."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from adaptive_flot.errors import AdaptiveFlotError, StudyError
from adaptive_flot.studies.study_file import load_study, shipped_studies
from tests.studies.conftest import WriteStudy

MISTAKES: dict[str, tuple[dict[str, Any], list[str]]] = {
    "unknown key": ({"seed": 3}, ["'seed'", "did you mean 'seeds'"]),
    "unknown key of the seeds": ({"seeds": {"first": 1, "cuont": 3}}, ["seeds.cuont", "did you mean 'count'"]),
    "unknown key of an estimator": (
        {"estimators": {"a": {"use": "rpem", "option": {}}}},
        ["estimators.a.option", "did you mean 'options'"],
    ),
    "missing seeds": ({"seeds": ...}, ["'seeds' is missing"]),
    "no seeds": ({"seeds": []}, ["seeds"]),
    "negative seed": ({"seeds": [1, -1]}, ["seeds", "-1"]),
    "seeds both ways": ({"seeds": {"count": 2, "listed": [1]}}, ["seeds", "first and count"]),
    "seeds neither way": ({"seeds": {"first": 2}}, ["seeds", "first and count"]),
    "no scenario": ({"scenarios": []}, ["scenarios"]),
    "unknown scenario": ({"scenarios": ["papr_scenario_1"]}, ["papr_scenario_1", "mean 'paper_scenario_1'"]),
    "unknown estimator": ({"estimators": ["rpm"]}, ["'rpm'", "did you mean 'rpem'"]),
    "unknown controller": ({"controllers": ["schedul"]}, ["'schedul'", "did you mean 'schedule'"]),
    "number for a name": ({"estimators": [3]}, ["estimators"]),
}


@pytest.mark.parametrize("changes", [m[0] for m in MISTAKES.values()], ids=list(MISTAKES))
def test_mistakes_are_one_line_with_file_and_key(write_study: WriteStudy, changes: dict[str, Any]) -> None:
    file = write_study(changes)
    words = next(w for c, w in MISTAKES.values() if c is changes)
    with pytest.raises(AdaptiveFlotError) as caught:
        load_study(file)
    text = str(caught.value)
    assert text.startswith(str(file)) and "\n" not in text
    assert all(word in text for word in words), text


@pytest.mark.parametrize("text", ["", "- a", "a: [", "\x00"])
def test_what_is_no_study_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "study.yaml"
    file.write_text(text)
    with pytest.raises(StudyError, match=r"study\.yaml"):
        load_study(file)


def test_unknown_name_is_refused_with_the_nearest_shipped_one() -> None:
    with pytest.raises(StudyError, match="did you mean 'paper_1000'"):
        load_study("paper_100")


@pytest.mark.parametrize("name", shipped_studies())
def test_shipped_studies_load(name: str) -> None:
    study = load_study(name)
    assert study.arms and study.seeds and len(study.description) > 20


def test_paper_study_is_what_its_name_says() -> None:
    study = load_study("paper_1000")
    assert study.seeds == tuple(range(1, 1001))
    assert [(a.scenario.name, a.combinations) for a in study.arms] == [("paper_scenario_1", (("schedule", "rpem"),))]


@pytest.mark.parametrize(
    ("seeds", "values"),
    [([3, 1, 3], (3, 1)), ({"first": 5, "count": 3}, (5, 6, 7)), ({"count": 2}, (1, 2))],
)
def test_seeds_as_list_or_as_range(write_study: WriteStudy, seeds: object, values: tuple[int, ...]) -> None:
    assert load_study(write_study({"seeds": seeds})).seeds == values


def test_names_alone_take_the_options_of_the_scenario(write_study: WriteStudy) -> None:
    """`forgetting` is 0.98 in the scenario, 0.9 in a variant of the study."""
    variant = {"use": "rpem", "options": {"forgetting": 0.9}}
    arm = load_study(write_study({"estimators": {"rpem": None, "quick": variant}})).arms[0]
    assert {n: p.options for n, p in arm.estimators.items()} == {
        "rpem": {"forgetting": 0.98},
        "quick": {"forgetting": 0.9},
    }
    assert arm.combinations == (("schedule", "rpem"), ("schedule", "quick"))


def test_left_out_plugins_are_those_of_each_scenario(write_study: WriteStudy) -> None:
    """With the cases that the scenario names; a shipped closed loop has its own."""
    study = load_study(write_study({"estimators": ..., "scenarios": ["short.yaml", "closed_loop_drift"]}))
    short, loop = study.arms
    assert short.combinations == (("schedule", "fixed"), ("schedule", "rpem"))
    assert set(loop.combinations) == {(c.controller, c.estimator) for c in loop.scenario.file.cases}


def test_controllers_of_the_study_run_with_every_estimator(write_study: WriteStudy) -> None:
    arm = load_study(write_study({"controllers": ["hold", "schedule"]})).arms[0]
    assert set(arm.combinations) == {(c, e) for c in ("hold", "schedule") for e in ("rpem", "fixed")}
