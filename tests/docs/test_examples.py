"""Examples in the documents do what they say."""

from __future__ import annotations

import doctest
import re
import sys
from pathlib import Path
from typing import get_args

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.discovery.results import Word
from adaptive_flot.processes.flotation.economics import Prices
from adaptive_flot.runner.scenario.keys import EconomicsPart
from tests.discovery.heated import Truth, tank_record

DOCS = Path(__file__).parents[1] / "docs"


def test_the_worked_example_of_the_economics_comes_out() -> None:
    found = doctest.testfile(str(DOCS / "economics.md"), module_relative=False)
    assert (found.attempted, found.failed) == (8, 0)


def test_the_price_table_holds_the_scenario_keys_and_their_defaults() -> None:
    text = (DOCS / "economics.md").read_text()
    rows = dict(re.findall(r"\| `(\w+_per_\w+)` \| ([\d.]+) \|", text))
    assert {key: float(value) for key, value in rows.items()} == EconomicsPart().model_dump()


def test_the_defaults_read_backwards() -> None:
    """2.5 cu per kg of chalcopyrite, 96.5 % payable, 0.346 kg of copper a kg."""
    assert Prices().metal / (0.346 * 0.965) == pytest.approx(7.48, abs=0.01)
    assert 63.546 / (63.546 + 55.845 + 2 * 32.06) == pytest.approx(0.346, abs=0.001)  # CuFeS2
    assert Prices().treatment / Prices().metal == pytest.approx(0.04)


def _readme_blocks(language: str) -> list[str]:
    text = (DOCS.parent / "README.md").read_text()
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def test_the_example_of_a_process_of_ones_own_runs_as_printed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Model and ten lines of the README: the file beside it is what is printed there, and so is the outcome."""
    monkeypatch.chdir(DOCS.parent)
    monkeypatch.setattr(sys, "path", sys.path[:])
    blocks = _readme_blocks("python")
    assert (DOCS / "heated_tank" / "heated_tank.py").read_text() in blocks
    (ten_lines,) = (b for b in blocks if "import make_model" in b)
    exec(compile(ten_lines, "README.md", "exec"), {})
    assert capsys.readouterr().out in _readme_blocks("text")


def test_the_record_of_the_example_is_that_of_the_tank_apart() -> None:
    table = pd.read_csv(DOCS / "heated_tank" / "tank.csv")
    inputs = table[["power_W", "fan_speed_1_s"]].to_numpy()
    truth = tank_record(Truth(noise=0.0), inputs=inputs)
    assert np.std(table["temperature_K"] - truth.outputs[:, 0]) == pytest.approx(0.05, rel=0.1)


def test_the_readme_explains_every_word_of_a_verdict() -> None:
    text = (DOCS.parent / "README.md").read_text()
    assert set(re.findall(r"^\| `(\w+)` \| ", text, re.MULTILINE)) >= set(get_args(Word))
