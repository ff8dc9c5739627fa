"""Each example runs as it stands, at a small size, and what its prose says is so."""

from __future__ import annotations

import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
Run = Callable[..., dict[str, Any]]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run an example in an empty folder; returns its variables."""

    def run_example(name: str, **sizes: int) -> dict[str, Any]:
        monkeypatch.chdir(tmp_path)
        for key, value in sizes.items():
            monkeypatch.setenv(f"EXAMPLE_{key.upper()}", str(value))
        found = runpy.run_path(str(EXAMPLES / name), run_name="example")
        assert any(path.is_file() for path in found["OUT"].rglob("*")), "an example leaves something to look at"
        return found

    return run_example


@pytest.mark.slow
def test_the_paper_in_which_the_recursive_method_predicts_the_grade_better(run: Run) -> None:
    runs = run("1_the_paper.py", seeds=2)["runs"]
    fits = runs.summary.set_index("estimator")
    for quantity, gain in (("concentrate_grade", 20.0), ("n", 5.0)):
        assert fits.loc["rpem", quantity] > fits.loc["fixed", quantity] + gain


def test_a_model_of_ones_own_finds_the_loss_behind_its_record(run: Run) -> None:
    loss = run("2_a_model_of_ones_own.py", rows=300)["loss"]
    assert loss["value"] == pytest.approx(65.0, abs=4 * loss["std"])
    assert abs(loss["value"] - 80.0) > 10 * loss["std"]


@pytest.mark.slow
def test_what_the_model_lacks_is_its_pump(run: Run) -> None:
    found = run("3_what_does_my_model_lack.py", rows=300)["found"]
    assert found.verdict.word == "named"
    assert {(e.effect.site, e.effect.driver) for e in found.verdict.effects} == {("pump_flow", "pump_voltage")}
    exponent = found.effects.set_index("coefficient").loc["exponent", "value"]
    assert exponent == pytest.approx(0.35, abs=0.02)


@pytest.mark.slow
def test_an_estimator_of_ones_own_keeps_the_contract_and_follows_the_parameters(run: Run) -> None:
    fits = run("4_an_estimator_of_ones_own.py", seeds=1)["runs"].table.set_index("estimator")
    for name in ("slow", "quick"):
        assert fits.loc[name, "n"] > fits.loc["fixed", "n"] + 5.0
        assert fits.loc[name, "concentrate_grade"] > fits.loc["fixed", "concentrate_grade"] + 20.0


def test_the_economic_controller_keeps_the_limit_and_earns_more_than_the_safe_voltage(run: Run) -> None:
    summary = run("5_an_economic_controller.py")["summary"].set_index("controller")
    over = summary["share of time over the limit [%]"]
    assert over["economic_mpc"] == over["hold 1.65 V"] == 0.0 < over["hold 2.5 V"]
    assert summary.loc["economic_mpc", "value"] > 1.1 * summary.loc["hold 1.65 V", "value"]


@pytest.mark.slow
def test_a_study_has_a_row_a_run(run: Run) -> None:
    table = run("6_a_study_of_a_thousand_runs.py", seeds=2)["table"]
    assert sorted(zip(table["estimator"], table["seed"], strict=True)) == [
        ("fixed", 1),
        ("fixed", 2),
        ("rpem", 1),
        ("rpem", 2),
    ]


def test_the_map_names_every_example() -> None:
    text = (EXAMPLES / "README.md").read_text()
    assert all(f"`{path.name}`" in text for path in EXAMPLES.glob("*.py"))
