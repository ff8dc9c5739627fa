"""Records whose outputs no recorded input explains: insufficient, and only those."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from adaptive_flot.discovery.assessment.explained import LEAST_EXPLAINED, nothing_explained, regression_shares
from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import make_problem
from adaptive_flot.errors import DataError
from adaptive_flot.processes.registry import make_model
from adaptive_flot.processes.zinc_level import read_record
from adaptive_flot.runner.commands.discover import discover_file
from tests.discovery.heated import changed, heated_tank, tank_record

ZINC = "data/flotation-cell-zinc/flotation-cell.csv"
HEADER = "Date and time,Feed rate,Upstream pH,CuSO4 added,Pulp level,Air flow rate\n"


def test_a_wandering_signal_is_not_explained() -> None:
    """Cross-validation: a random walk regresses well on any slow input in the rows fitted, and not on others."""
    found = []
    for seed in range(20):
        walk = np.cumsum(np.random.default_rng(seed).standard_normal(600))
        wandering = changed(tank_record(seed=seed), walk - np.linspace(walk[0], walk[-1], 600))
        found.append(regression_shares(wandering, (0,))[0])
    assert np.median(found) < 0.05 and np.mean(np.array(found) > LEAST_EXPLAINED) < 0.15


@pytest.mark.parametrize("seed", [0, 4, 38])
def test_a_tank_is_explained_where_either_way_fails(seed: int) -> None:
    """Slow tanks wander: in seed 38 the regression explains nothing, and the model with a large effect missing does."""
    record = tank_record(seed=seed)
    problem = make_problem(record, heated_tank(), ("efficiency", "loss"), burn_in=30, guard=5)
    fit = Fitter(problem).fit(heated_tank(), rounds=1)
    assert fit is not None and nothing_explained(problem, fit) is None


def test_an_output_that_hears_of_no_input_is_insufficient() -> None:
    """The oscillation of a loop somewhere else, in a record whose inputs move all the time."""
    rng = np.random.default_rng(1)
    y = 310 + np.convolve(rng.standard_normal(660), np.ones(5), "same")[30:630]
    found = discover(heated_tank(), changed(tank_record(), y))
    assert found.verdict.word == "insufficient" and "explain too little" in found.verdict.reason
    assert found.verdict.effects == () and found.before is found.after is not None  # fitted, and not searched


def test_the_zinc_cell_is_insufficient_and_says_why(shared_file: Callable[[str], Path]) -> None:
    """Air was held constant, and the level is a controlled one whose valve and set point nobody recorded."""
    found = discover_file(shared_file(ZINC), make_model("zinc-level"))
    verdict = found.verdict
    assert verdict.word == "insufficient" and verdict.effects == ()
    assert "explain too little" in verdict.reason and "actuator" in verdict.reason
    assert any("air_flow hardly moves" in n for n in verdict.notes)


def test_the_longest_stretch_without_a_gap_is_read(tmp_path: Path) -> None:
    seconds = [*range(0, 300, 30), *range(900, 1800, 30), *range(1860, 2000, 31)]
    rows = [f"15/12/2004 19:{s // 60:02d}:{s % 60:02d},330,10.8,{k},29,2.8\n" for k, s in enumerate(seconds)]
    file = tmp_path / "cell.csv"
    file.write_text(HEADER + "".join(rows))
    record = read_record(file)
    assert len(record) == 30 and record.dt == pytest.approx(30.0)
    assert record.inputs[0, 2] == 10.0 and np.all(record.outputs == 29.0)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (HEADER.replace("Pulp level", "Level") + "15/12/2004 19:00:00,1,1,1,1,1\n", "Pulp level"),
        (HEADER + "2004-12-15,1,1,1,1,1\n", "2004-12-15"),
    ],
)
def test_another_file_is_refused_in_one_line(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "cell.csv"
    file.write_text(text)
    with pytest.raises(DataError, match=says):
        read_record(file)
