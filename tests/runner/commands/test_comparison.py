"""The comparison against cases worked out by hand: pairing by seed, shares of a gain, results that overlap."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.errors import ResultError
from adaptive_flot.runner.commands.comparison import Comparison, Contender, SeedSpread, compare


def row(estimator: str, seed: int, value: float, controller: str = "mpc", **more: Any) -> dict[str, Any]:
    names = {"scenario": "drift", "conditions": "abc", "grade_limit": 0.2, "result": "a"}
    return {**names, "controller": controller, "estimator": estimator, "seed": seed, "value_cu_h": value, **more}


def only(rows: list[dict[str, Any]]) -> Comparison:
    (found,) = compare(pd.DataFrame(rows))
    return found


def contender(comparison: Comparison, estimator: str, result: str = "") -> Contender:
    (found,) = (c for c in comparison.contenders if (c.estimator, c.result) == (estimator, result))
    return found


def test_the_share_is_paired_by_seed_whatever_the_order() -> None:
    """Seed 1: 10, 11 of 12, half the gain; seed 2: 20, 23 of 24, three quarters; seed 3 has no oracle."""
    rows = [row("rpem", 2, 23.0), row("rpem", 3, 99.0), row("rpem", 1, 11.0)]
    rows += [row("fixed", 1, 10.0), row("fixed", 2, 20.0), row("fixed", 3, 30.0)]
    rows += [row("oracle", 2, 24.0), row("oracle", 1, 12.0)]
    found = only(rows)
    assert found.share(contender(found, "rpem"), "value_cu_h").tolist() == [0.5, 0.75]
    assert found.share(contender(found, "fixed"), "value_cu_h").tolist() == [0.0, 0.0]
    assert found.share(contender(found, "oracle"), "value_cu_h").tolist() == [1.0, 1.0]
    assert found.gain(contender(found, "rpem"), "value_cu_h").tolist() == [2.0, 4.0]
    assert not found.same_seeds


@given(
    fixed=st.floats(1.0, 1e3),
    gain=st.floats(0.01, 10.0),
    share=st.floats(-2.0, 2.0),
    factor=st.floats(0.1, 100.0),
)
def test_the_share_does_not_depend_on_the_currency(fixed: float, gain: float, share: float, factor: float) -> None:
    values = {"fixed": fixed, "oracle": fixed * (1 + gain), "rpem": fixed * (1 + share * gain)}
    found = only([row(name, 1, factor * value) for name, value in values.items()])
    np.testing.assert_allclose(found.share(contender(found, "rpem"), "value_cu_h"), [share], atol=1e-9)


@pytest.mark.parametrize("oracle", [9.0, 10.0, 10.005])
def test_there_is_no_share_of_a_gain_that_is_none(oracle: float) -> None:
    found = only([row("fixed", 1, 10.0), row("oracle", 1, oracle), row("rpem", 1, 10.001)])
    assert np.isnan(found.share(contender(found, "rpem"), "value_cu_h")).all()
    assert found.gain(contender(found, "rpem"), "value_cu_h") == pytest.approx([oracle - 10.0])


def test_another_controller_has_its_own_gain_and_none_without_an_oracle() -> None:
    rows = [row("fixed", 1, 10.0), row("oracle", 1, 12.0), row("fixed", 1, 5.0, controller="pi")]
    found = only(rows)
    pi = found.contenders[-1]
    assert pi.controller == "pi" and found.share(pi, "value_cu_h").size == 0


def test_results_that_overlap_are_told_apart_and_others_are_joined() -> None:
    """Seed 1 of rpem is in both results: two contenders, each against the one oracle; fixed is joined over results."""
    rows = [row("rpem", 1, 11.0), row("fixed", 1, 10.0), row("oracle", 1, 12.0)]
    rows += [row("rpem", 1, 11.5, result="b"), row("fixed", 2, 10.0, result="b")]
    found = only(rows)
    assert [(c.estimator, c.result) for c in found.contenders] == [
        ("rpem", "a"),
        ("rpem", "b"),
        ("fixed", ""),
        ("oracle", ""),
    ]
    assert contender(found, "fixed").seeds == [1, 2]
    assert found.share(contender(found, "rpem", "b"), "value_cu_h").tolist() == [0.75]
    assert contender(found, "rpem", "b").label == "mpc, rpem (b)"


def test_each_of_two_results_is_held_against_its_own_oracle() -> None:
    rows = [row(name, 1, value) for name, value in {"fixed": 10.0, "oracle": 12.0, "rpem": 11.0}.items()]
    rows += [row(name, 1, value, result="b") for name, value in {"fixed": 20.0, "oracle": 24.0, "rpem": 23.0}.items()]
    found = only(rows)
    shares = [found.share(contender(found, "rpem", r), "value_cu_h").tolist() for r in ("a", "b")]
    assert shares == [[0.5], [0.75]]


def test_a_run_that_a_result_holds_twice_is_refused() -> None:
    with pytest.raises(ResultError, match="a: holds mpc, rpem, seed 4 more than once"):
        only([row("rpem", 4, 1.0), row("rpem", 4, 1.0)])


def test_copies_that_ask_the_same_stand_side_by_side_and_others_apart() -> None:
    """A copy of a scenario with another option has another name but the same conditions."""
    rows = [row("rpem", 1, 1.0), row("rpem", 1, 2.0, scenario="mine", result="b")]
    rows += [row("rpem", 1, 3.0, scenario="feed", conditions="def", grade_limit=0.25)]
    first, second = compare(pd.DataFrame(rows))
    assert (first.scenario, len(first.contenders)) == ("drift / mine", 2)
    assert (second.scenario, second.grade_limit) == ("feed", 0.25)


def test_runs_without_economics_compare_by_name() -> None:
    table = pd.DataFrame([row("rpem", 1, 1.0), row("rpem", 2, 2.0)]).drop(
        columns=["conditions", "grade_limit", "value_cu_h"]
    )
    (found,) = compare(table.assign(fit_n=[97.0, 99.0]))
    assert found.contenders[0].spread("fit_n") == SeedSpread(98.0, 97.0, 99.0)
    assert np.isnan(found.grade_limit) and found.share(found.contenders[0], "value_cu_h").size == 0


def test_values_that_are_not_finite_are_counted_not_hidden() -> None:
    found = only([row("rpem", 1, 1.0), row("rpem", 2, float("nan")), row("rpem", 3, 3.0)])
    assert found.contenders[0].spread("value_cu_h") == SeedSpread(2.0, 1.0, 3.0, not_finite=1)


def test_counts_are_summed_over_the_runs_largest_first() -> None:
    found = only([row("rpem", 1, 1.0, control_retried=2, control_ok=7), row("rpem", 2, 1.0, control_ok=9)])
    assert list(found.contenders[0].counts("control").items()) == [("ok", 16), ("retried", 2)]
    assert "control_ok" not in found.contenders[0].metrics and "value_cu_h" in found.contenders[0].metrics
