"""A map file is read as it is written, and each wrong line is named with what to write instead."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from adaptive_flot.errors import DataError
from adaptive_flot.records.tag_map import TagMap, load_tag_map

GOOD = """\
time: {column: Timestamp, zone: Europe/London}
grid: {step: 10 s, hold_at_most: 30 s, gaps: split}
air_flow: {tag: FIC_101.PV, unit: L/min, bad: [Bad Input, -9999]}
concentrate_grade: {tag: AI_401.PV, unit: "%", delay: 90 s, range: [0, 60]}
"""


def written(folder: Path, text: str) -> Path:
    file = folder / "map.yaml"
    file.write_text(text)
    return file


def test_the_map_of_the_documents_is_read(tmp_path: Path) -> None:
    found = load_tag_map(written(tmp_path, GOOD))
    air, grade = found.quantities["air_flow"], found.quantities["concentrate_grade"]
    assert (found.time.column, found.time.zone, found.grid.step) == ("Timestamp", "Europe/London", "10 s")
    assert (air.tag, air.unit, air.bad) == ("FIC_101.PV", "L/min", ("Bad Input", "-9999"))
    assert (grade.delay_s, grade.range) == (90.0, (0.0, 60.0))


def test_a_map_that_is_written_is_read_back_equal(tmp_path: Path) -> None:
    found = load_tag_map(written(tmp_path, GOOD.replace("column: Timestamp", "column: [Date, Time]")))
    assert load_tag_map(written(tmp_path, found.text())) == found


@pytest.mark.parametrize(
    ("old", "new", "line", "said"),
    [
        ("unit: L/min", "unit: L/mn3", 3, "air_flow.unit: 'L/mn3' is no unit; write one as L/min"),
        ("unit: L/min", "unit: Nm3/h", 3, "counts gas at normal conditions"),
        ("unit: L/min", "untit: L/min", 3, "did you mean 'unit'?"),
        ("tag: FIC_101.PV, ", "", 3, "key 'air_flow.tag' is missing; add it"),
        ("tag: FIC_101.PV", "tag: 101", 3, "air_flow.tag: Input should be a valid string, got 101"),
        ("{tag: FIC_101.PV, unit: L/min, bad: [Bad Input, -9999]}", "FIC_101.PV", 3, "air_flow: "),
        ("zone: Europe/London", "zone: Europe/Londn", 1, "time.zone: no time zone; write one as Europe/London"),
        ("zone:", "format: dayfirst, zone:", 1, "time.format: no form of time; write one of iso, day-first"),
        ("30 s", "30", 2, "a duration has a unit; write it as 10 s"),
        ("30 s", "30 m", 2, "'30 m' is no duration; write one as 10 s"),
        ("gaps: split", "gaps: spilt", 2, "grid.gaps: Input should be 'split', 'longest' or 'refuse'"),
        ("90 s", "0 s", 4, "concentrate_grade.delay: a duration is longer than nothing"),
        ("[0, 60]", "[0, x]", 4, "concentrate_grade.range.1: Input should be a valid number"),
    ],
)
def test_a_wrong_line_is_named_with_what_to_write(tmp_path: Path, old: str, new: str, line: int, said: str) -> None:
    assert old in GOOD
    file = written(tmp_path, GOOD.replace(old, new))
    with pytest.raises(DataError) as caught:
        load_tag_map(file)
    message = str(caught.value)
    assert message.startswith(f"{file}: line {line}: ") and said in message and len(message.splitlines()) == 1


def test_a_quantity_that_the_model_lacks_is_named_with_the_nearest(tmp_path: Path) -> None:
    found = load_tag_map(written(tmp_path, GOOD.replace("air_flow:", "airflow:")))
    with pytest.raises(DataError, match="airflow: no such quantity of model 'flotation'; did you mean 'air_flow'"):
        found.check_names(("air_flow", "concentrate_grade"), "flotation")


def test_an_empty_map_is_refused_and_an_empty_one_in_memory_is_the_start_of_a_guess(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="write at least one line"):
        load_tag_map(written(tmp_path, ""))
    assert TagMap().quantities == {} and TagMap().text() == ""


def test_the_map_is_read_without_the_engine_and_its_libraries() -> None:
    """A link to a plant may run on a small machine."""
    heavy = "[m for m in ('pandas', 'casadi', 'pint') if m in sys.modules]"
    code = f"import sys, adaptive_flot.records.tag_map; print({heavy})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
