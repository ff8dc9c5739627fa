"""`discover --budget`: a verdict in words, of one record and of several; and what is no budget."""

from __future__ import annotations

from pathlib import Path

import pytest

from adaptive_flot.discovery.since_reference.changes import find_changes
from tests.cli.conftest import Call
from tests.cli.discover.test_discover import write_tank
from tests.discovery.hypotheses.tank import record, tank


def test_a_budget_bounds_several_records_too(call: Call, tmp_path: Path) -> None:
    """A budget of no time at all names nothing; the command line takes one for several records, as for one."""
    write_tank(tmp_path)
    lines = (tmp_path / "tank.csv").read_text().splitlines(keepends=True)
    (tmp_path / "again.csv").write_text("".join(lines[:-1]))  # the same record twice would be refused
    result = call("discover", "tank.csv", "again.csv", "--model", "heated:make_model", "--budget", "1", "--no-report")
    assert result.code == 0 and result.err == ""
    spent = find_changes(tank(), [record("a", 1), record("b", 2)], budget=1e-6).verdict
    assert spent.word == "abstain" and "the budget ended before all" in spent.reason


@pytest.mark.parametrize("seconds", ["0", "-3", "soon"])
def test_a_budget_is_a_number_of_seconds(call: Call, tmp_path: Path, seconds: str) -> None:
    write_tank(tmp_path)
    result = call("discover", "tank.csv", "--model", "heated:make_model", "--budget", seconds)
    assert result.code == 2 and "--budget" in result.err
    assert {f.name for f in tmp_path.iterdir()} == {"tank.csv", "heated.py"}
