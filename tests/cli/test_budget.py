"""`discover --budget`: a verdict in words, and no budget where it has no meaning."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import Call
from tests.cli.test_discover import write_tank


def test_several_records_take_no_budget(call: Call, tmp_path: Path) -> None:
    write_tank(tmp_path)
    result = call("discover", "tank.csv", "tank.csv", "--model", "heated:make_model", "--budget", "5")
    assert result.code == 2 and "--budget" in result.err and len(result.err.splitlines()) == 1


@pytest.mark.parametrize("seconds", ["0", "-3", "soon"])
def test_a_budget_is_a_number_of_seconds(call: Call, tmp_path: Path, seconds: str) -> None:
    write_tank(tmp_path)
    result = call("discover", "tank.csv", "--model", "heated:make_model", "--budget", seconds)
    assert result.code == 2 and "--budget" in result.err
    assert {f.name for f in tmp_path.iterdir()} == {"tank.csv", "heated.py"}
