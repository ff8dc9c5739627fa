"""What a person gives from Python in place of a record, a name or a budget is one line, or what was meant."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

import adaptive_flot as af
from adaptive_flot.errors import AdaptiveFlotError, DataError, ModelError

INPUTS = pd.DataFrame({"time_s": [0.0, 60.0, 120.0], "pump_voltage_V": [3.0, 3.0, 4.0]})


@pytest.mark.parametrize("given", [None, [1.0, 2.0], {"time_s": [0.0]}], ids=["none", "list", "dict"])
def test_what_is_no_record_is_one_line(given: Any) -> None:
    with pytest.raises(DataError, match=f"and not {type(given).__name__}; give a path or a DataFrame"):
        af.simulate("cascaded-tanks", given)


@pytest.mark.parametrize("budget", [-1.0, 0.0, float("nan")])
def test_a_budget_below_a_second_is_refused_as_in_the_shell(budget: float) -> None:
    with pytest.raises(ModelError, match=r"budget = .* s; give at least 1"):
        af.discover("cascaded-tanks", INPUTS, budget=budget)


def test_one_output_may_be_given_by_its_name() -> None:
    """And not as its letters: what is refused is the name as a whole."""
    inputs = pd.DataFrame({"time_s": 4.0 * np.arange(100), "pump_voltage_V": np.linspace(3.0, 4.0, 100)})
    with pytest.raises(AdaptiveFlotError, match="has no 'levle' among its outputs"):
        af.estimate("cascaded-tanks", af.simulate("cascaded-tanks", inputs).table, outputs="levle")


def test_times_in_words_are_sent_to_import() -> None:
    table = INPUTS.assign(time_s=["noon", "one", "two"], level_V=1.0)
    with pytest.raises(DataError, match="'noon' is not a number; correct it, or make a record of it with"):
        af.estimate("cascaded-tanks", table)
