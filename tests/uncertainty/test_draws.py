"""Draws of constants: their distribution, their quantiles against runs one by one, and shares with a known answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from SALib.sample import sobol
from scipy import stats

from adaptive_flot.errors import ModelError, RangeError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.uncertainty.draws import FEWEST_BLOCKS, QUANTILES, blocks_of, draw
from adaptive_flot.uncertainty.ranges_file import RangePart, Uncertain
from adaptive_flot.uncertainty.ranking import shares_of

ROWS = 30


def mixing(highest: float = np.inf) -> Model:
    """dx/dt = u - x / tau, y = a x + b: at rest a u tau + b, linear in each constant."""

    def equations(s: Scope) -> None:
        s.derivative("x", s.input("u") - s.state("x") / s.parameter("tau"))
        s.output("y", s.parameter("a") * s.state("x") + s.parameter("b"))
        s.output("u_seen", s.input("u") + 0 * s.state("x"))

    return Model(
        name="mixing",
        states=(Quantity("x", "-", "content", -10.0, highest),),
        inputs=(Quantity("u", "-", ""),),
        parameters=(
            Parameter("a", 2.0, "-", "", None, 0.0, 10.0, 1.0),
            Parameter("b", 1.0, "-", "", None, -10.0, 10.0, 1.0),
            Parameter("tau", 2.0, "s", "", None, 0.1, 10.0, 1.0),
        ),
        outputs=(Quantity("y", "-", ""), Quantity("u_seen", "-", "")),
        equations=equations,
    )


def constants(model: Model, **parts: RangePart) -> list[Uncertain]:
    return [Uncertain(model.parameters[model.index("parameters", name)], part) for name, part in parts.items()]


def record(level: float = 1.0) -> Dataset:
    time = np.linspace(0.0, 0.5 * (ROWS - 1), ROWS)
    u = np.where(time < 5.0, level, 2 * level)[:, None]
    return Dataset("steps", time, 0.5, u, np.full((ROWS, 2), np.nan))


def test_draws_have_the_distribution_asked_for() -> None:
    shares = (np.arange(2000) + 0.5) / 2000
    uniform, normal, cut = constants(
        mixing(), a=RangePart(between=(1.5, 3.0)), b=RangePart(std=0.2), tau=RangePart(share=2.0)
    )
    assert stats.kstest(uniform.values(shares), stats.uniform(1.5, 1.5).cdf).statistic < 1e-3
    assert stats.kstest(normal.values(shares), stats.norm(1.0, 0.2).cdf).statistic < 1e-3
    values = cut.values(shares)  # the physical range cuts it
    assert values.min() >= 0.1 and values.max() <= 10.0 and np.all(np.diff(values) > 0)


def test_bands_are_those_of_runs_one_by_one() -> None:
    model = mixing()
    made = draw(model, constants(model, a=RangePart(between=(1.5, 3.0)), tau=RangePart(share=0.1)), record(), 64)
    assert len(made.values) == 64 and len(made.good) == 64
    runs = []
    for a, tau in made.values:
        p = np.array([a, 1.0, tau])
        y = Stepper(model, 0.5).simulate(np.array([tau]), record().inputs[1:], p).outputs[:, 0]
        runs.append([a * tau + 1.0, *y])
    np.testing.assert_allclose(made.outputs[:, :, 0], runs, rtol=1e-9)
    np.testing.assert_allclose(made.quantiles("y"), np.quantile(runs, QUANTILES, axis=0).T, rtol=1e-9)
    np.testing.assert_allclose(made.nominal[0], [5.0, 1.0], rtol=1e-9)
    table = made.table()
    assert list(table)[:4] == ["time_s", "u", "y_nominal", "y_q05"] and len(table) == ROWS
    np.testing.assert_array_equal(table["u_seen_q95"], table["u"])


def test_draws_are_the_same_each_time_and_no_more_than_asked_for() -> None:
    model = mixing()
    parts = constants(model, a=RangePart(between=(1.5, 3.0)), b=RangePart(std=0.2))
    one, two = (draw(model, parts, record(), 100) for _ in range(2))
    assert len(one.values) == 64  # 2^4 blocks of four
    np.testing.assert_array_equal(one.values, two.values)
    np.testing.assert_array_equal(one.outputs, two.outputs)
    assert one.shares("y") == two.shares("y")


def test_shares_of_a_sum_are_those_of_its_variances() -> None:
    """Y = 2 a + b at x = 2: variances 4 sa^2 and sb^2; a constant that does nothing has no share."""
    model = mixing()
    parts = constants(
        model, a=RangePart(std=0.1), b=RangePart(std=0.2), tau=RangePart(between=(2.0 - 1e-9, 2.0 + 1e-9))
    )
    rest = replace(record(), inputs=np.ones((ROWS, 1)))
    made = draw(model, parts, rest, 5 * 512)
    first, second, third = made.shares("y")
    assert {first.label, second.label} == {"a", "b"} and third.label == "tau"
    for share in (first, second):
        assert share.total == pytest.approx(0.5, abs=0.05) and share.alone == pytest.approx(0.5, abs=0.05)
        assert 0 < share.total_half < 0.2
    assert third.total == pytest.approx(0.0, abs=1e-6)
    assert made.shares("u_seen") == ()  # it does not vary


def test_shares_of_a_known_function() -> None:
    """Ishigami and Homma (1990): sin x + 7 sin^2 y + 0.1 z^4 sin x, whose indices are known in closed form."""
    problem = {"num_vars": 3, "names": list("xyz"), "bounds": [[-np.pi, np.pi]] * 3}
    x, y, z = sobol.sample(problem, 2048, calc_second_order=False, seed=1).T
    values = np.sin(x) + 7 * np.sin(y) ** 2 + 0.1 * z**4 * np.sin(x)
    values[10] = np.nan  # its block is left out
    shares = shares_of(list("xyz"), values, 1)
    assert [s.label for s in shares] == ["x", "y", "z"]
    np.testing.assert_allclose([s.total for s in shares], [0.5576, 0.4424, 0.2437], atol=0.03)
    np.testing.assert_allclose([s.alone for s in shares], [0.3139, 0.4424, 0.0], atol=0.03)


def test_a_draw_that_leaves_the_range_is_left_out() -> None:
    """Content 2 tau after the step must stay below 4.6: not where tau is above 2.3."""
    model = mixing(highest=4.6)
    made = draw(model, constants(model, tau=RangePart(between=(1.5, 2.5)), a=RangePart(share=0.1)), record(), 64)
    too_much = made.values[:, 0] > 2.31
    assert 0 < too_much.sum() < 32
    assert set(np.flatnonzero(~np.isfinite(made.outputs[:, -1, 0]))) >= set(np.flatnonzero(too_much))
    assert np.isfinite(made.quantiles("y")).all() and np.isfinite([s.total for s in made.shares("y")]).all()


def test_what_can_not_be_drawn_is_said() -> None:
    model = mixing(highest=4.6)
    parts = constants(model, tau=RangePart(between=(1.5, 9.0)), a=RangePart(share=0.1))
    with pytest.raises(RangeError, match=r"draws leave the model's physical range; give smaller ranges"):
        draw(model, parts, record(), 64)
    with pytest.raises(RangeError, match="nominal constants leaves the model's range"):
        draw(mixing(highest=3.0), parts, record(), 64)
    with pytest.raises(ModelError, match=f"give at least {4 * FEWEST_BLOCKS}"):
        blocks_of(4 * FEWEST_BLOCKS - 1, 2)
    moving = replace(record(), parameters={"a": np.full(ROWS, 2.0)})
    with pytest.raises(ModelError, match="moves the constant 'a'"):
        draw(model, parts, moving, 64)
