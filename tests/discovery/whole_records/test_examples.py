"""A shared example with an answer beside it.

The others, and measured data, are judged by `benchmarks.real_records.measured`.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pandas as pd

from adaptive_flot.parallel import available_processes
from adaptive_flot.processes.registry import make_model
from adaptive_flot.runner.commands.discover import discover_file

EXAMPLE = "example_froth_recovery_step"


def test_an_example_is_judged_as_its_answer_says(shared_file: Callable[[str], Path], tmp_path: Path) -> None:
    """The froth recovery of another cell drops at 1500 s: site, driver and onset are found, the error falls by 80 %.

    Of its 50 minutes the 18 around the drop, which take a third of the time of all.
    """
    answer = json.loads(shared_file("examples/answers.json").read_text())[EXAMPLE]
    table = pd.read_csv(shared_file(f"examples/{EXAMPLE}.csv"))
    record = tmp_path / "record.csv"
    table[table["time_s"].between(1000.0, 2100.0)].to_csv(record, index=False)
    found = discover_file(record, make_model("flotation"), processes=min(2, available_processes())).verdict
    assert found.word == answer["verdict"] == "named"
    (effect,) = (e.effect for e in found.effects)
    assert effect.site in answer["site"] and effect.driver in answer["driver"]
    assert abs(effect.coefficients["onset"] - 1500.0) < 30.0
    grade = next(c for c in found.error if c.output == "concentrate_grade")
    assert grade.after < 0.2 * grade.before
