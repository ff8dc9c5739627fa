"""`adaptive-flot discover` with a reference: what it writes and says, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from tests.cli.conftest import Call
from tests.discovery.hypotheses import tank

MODEL = f"{tank.__file__}:make_model"


@pytest.fixture
def records(tmp_path: Path) -> tuple[Path, Path]:
    """A record with a draught, and one without."""
    paths = tmp_path / "new.csv", tmp_path / "old.csv"
    for path, data in zip(paths, (tank.record("new", 1, tank.DRAUGHT), tank.record("old", 2)), strict=True):
        tank.table(data).to_csv(path, index=False)
    return paths


def test_what_has_changed_is_said_and_written_and_the_written_model_has_nothing_left_to_find(
    call: Call, records: tuple[Path, Path], tmp_path: Path
) -> None:
    """The loss is 65 % larger (a factor exp(0.5)): first sentence, verdict, page and extended model say so."""
    new, old = records
    result = call("discover", new, "--reference", old, "--model", MODEL, "--out", "r", "--save-model", "m.yaml")
    assert result.code == 0, result.err
    assert result.out.startswith("named: Heat loss is 65 % larger.")
    verdict = json.loads((tmp_path / "r" / "verdict.json").read_text())
    assert verdict["verdict"] == "named" and verdict["effects"][0]["site"] == "heat_loss"
    page = (tmp_path / "r" / "report.html").read_text()
    assert "Heat loss is 65 % larger" in page and "Reference: old" in page and "<svg" not in verdict["reason"]

    tank.table(tank.record("later", 5, tank.DRAUGHT)).to_csv(tmp_path / "later.csv", index=False)
    later = call("discover", "later.csv", "--reference", new, "--model", "m.yaml", "--out", "r2", "--no-report")
    assert later.code == 0 and later.out.startswith("none: "), later.out + later.err


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (["--reference", "nowhere.csv"], "nowhere.csv"),
        (["--reference", "old.csv", "--limit", "power=0:1000"], "--limit"),
        (["nowhere.csv"], "nowhere.csv"),
    ],
)
def test_a_mistake_is_one_line_and_writes_nothing(
    call: Call, records: tuple[Path, Path], tmp_path: Path, more: list[str], says: str
) -> None:
    result = call("discover", records[0], "--model", MODEL, "--out", "r", *more)
    assert result.code == 2 and says in result.err and len(result.err.splitlines()) == 1
    assert not (tmp_path / "r").exists()


@pytest.mark.parametrize(
    "given",
    [["new.csv", "new.csv"], ["new.csv", "copy.csv"], ["new.csv", "--reference", "copy.csv"]],
    ids=["twice", "a copy", "its own reference"],
)
def test_the_same_record_given_twice_is_refused(
    call: Call, records: tuple[Path, Path], tmp_path: Path, given: list[str]
) -> None:
    (tmp_path / "copy.csv").write_bytes(records[0].read_bytes())
    result = call("discover", *given, "--model", MODEL, "--out", "r")
    assert result.code == 2 and len(result.err.splitlines()) == 1
    assert f"{given[-1]}: the same record as new.csv; give each once" in result.err
    assert not (tmp_path / "r").exists()


def test_records_of_different_steps_are_refused_before_anything_is_fitted(
    call: Call, records: tuple[Path, Path], tmp_path: Path
) -> None:
    table = pd.read_csv(records[1])
    table.assign(time_s=1.0002 * table["time_s"]).to_csv(tmp_path / "other.csv", index=False)
    result = call("discover", "new.csv", "--reference", "other.csv", "--model", MODEL, "--out", "r")
    assert result.code == 2 and len(result.err.splitlines()) == 1
    assert result.err.startswith("adaptive-flot: ") and "one row every " in result.err and "other" in result.err
    assert "'grid: {step: " in result.err
    assert not (tmp_path / "r").exists()


def judged_with_holes(call: Call, records: tuple[Path, Path], tmp_path: Path, *kept: slice) -> str:
    """The page on the new record with some rows lost, in which the draught is named all the same."""
    new, old = records
    table = pd.read_csv(new)
    pd.concat([table[rows] for rows in kept]).to_csv(tmp_path / "holed.csv", index=False)
    result = call("discover", "holed.csv", "--reference", old, "--model", MODEL, "--out", "r")
    assert result.code == 0 and result.out.startswith("named: Heat loss is 6"), result.out + result.err
    return (tmp_path / "r" / "report.html").read_text()


def test_a_hole_splits_a_record_and_nothing_is_fitted_across_it(
    call: Call, records: tuple[Path, Path], tmp_path: Path
) -> None:
    """The clock goes on over two holes. No stretch has half of the rows, and each is taken as a record."""
    page = judged_with_holes(call, records, tmp_path, slice(0, 180), slice(200, 380), slice(420, None))
    assert "holed, stretch 1" in page and "holed, stretch 3" in page


def test_the_longest_stretch_stands_for_a_record_of_which_it_has_half(
    call: Call, records: tuple[Path, Path], tmp_path: Path
) -> None:
    """Events in time take one record: a hole of a few rows near its end must not cost them."""
    page = judged_with_holes(call, records, tmp_path, slice(0, 350), slice(358, None))
    assert "stretch 1 is used, the longest, with 350 of 492 rows" in page
    assert "Events in time were not looked for" not in page
