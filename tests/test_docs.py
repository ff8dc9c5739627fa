"""Examples in the documents do what they say."""

from __future__ import annotations

import doctest
import re
from pathlib import Path

import pytest

from adaptive_flot.economics import Prices
from adaptive_flot.runner.scenario_file import EconomicsPart

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
