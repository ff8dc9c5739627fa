"""Protects the parts of the comparison: criterion, noise without a model, usual errors, stretches, ties."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.discovery.hypotheses.comparison import blocks_of, reduction
from adaptive_flot.discovery.hypotheses.cross_validation import stretches
from adaptive_flot.discovery.hypotheses.families import hypotheses
from adaptive_flot.discovery.hypotheses.joint.known_before import loose_constants, scattered_starts
from adaptive_flot.discovery.hypotheses.joint.rows import TAIL, Rows, noise_floor, rows_of
from adaptive_flot.discovery.hypotheses.joint.usual_errors import usual_errors
from adaptive_flot.greybox import Dataset
from adaptive_flot.greybox.model import FloatArray
from tests.discovery.hypotheses.tank import tank


def dataset(outputs: FloatArray, inputs: FloatArray | None = None) -> Dataset:
    """A record of these outputs (N,), one row a second."""
    n = len(outputs)
    given_inputs = np.zeros(n) if inputs is None else inputs
    return Dataset("r", np.arange(n, dtype=np.float64), 1.0, given_inputs[:, None], outputs[:, None])


def rows(data: Dataset, size: float = 1.0) -> Rows:
    """All rows but the first of one output."""
    return rows_of([data], [0], [np.full((len(data), 1), size)])


def test_the_criterion_is_that_of_students_t() -> None:
    """An independent reference: twice the negative logarithm of scipy's density, but for its constant."""
    from scipy.stats import t

    e = np.linspace(-8.0, 8.0, 40)
    loss = rows(dataset(np.zeros(40)), size=2.0).losses([e[:, None]])[0][4:, 0]
    z = e[4:] / 2.0
    expected = -2 * (t.logpdf(z, TAIL) - t.logpdf(0.0, TAIL)) * TAIL / (TAIL + 1)
    assert loss == pytest.approx(expected)


def test_what_was_not_measured_costs_nothing_and_what_has_left_the_model_costs_much() -> None:
    y = np.zeros(40)
    y[20] = np.nan
    e = np.zeros((40, 1))
    e[20], e[30] = np.nan, np.inf
    loss = rows(dataset(y)).losses([e])[0][:, 0]
    assert loss[20] == 0 and loss[30] > 100 and loss.sum() == loss[30]


@given(st.floats(-3, 3), st.floats(-0.1, 0.1), st.floats(0.01, 10), st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_noise_from_differences_does_not_depend_on_what_is_smooth(
    level: float, ramp: float, noise: float, seed: int
) -> None:
    """A constant and a ramp leave it as it is: the noise is found within its own scatter."""
    k = np.arange(2000, dtype=np.float64)
    y = noise * (level + ramp * k + np.random.default_rng(seed).normal(size=2000))
    assert noise_floor([dataset(y)], [0])[0] == pytest.approx(noise, rel=0.15)


def test_errors_count_by_what_is_usual_where_the_plant_is() -> None:
    """Errors ten times as large about input 1: sizes there are as large, and elsewhere at least the overall one."""
    rng = np.random.default_rng(0)
    inputs = np.repeat([0.0, 1.0], 500) + rng.uniform(-0.2, 0.2, 1000)
    errors = rng.normal(size=1000) * np.where(inputs > 0.5, 10.0, 1.0)
    data = dataset(np.zeros(1000), inputs)
    usual = usual_errors(rows(data), [errors[:, None]], np.array([0.1]))
    sizes = usual.sizes(data)[:, 0]
    assert np.median(sizes[inputs > 0.5]) == pytest.approx(10.0, rel=0.2)
    assert sizes.min() == pytest.approx(usual.overall[0])


def test_every_row_is_left_out_once_and_no_record_as_a_whole() -> None:
    both = rows_of([dataset(np.zeros(103)), dataset(np.zeros(57))], [0], [np.ones((103, 1)), np.ones((57, 1))])
    masks = stretches(both, 5)
    for i, n in enumerate((103, 57)):
        times = np.sum([m[i] for m in masks], axis=0)
        assert (times == 1).all()
        assert all(0 < m[i].sum() < n / 2 for m in masks)


def test_blocks_are_longer_than_the_errors_remember() -> None:
    """White errors ask for the shortest blocks, a slow sine for long ones; together they cover the rows that count."""
    white = np.random.default_rng(0).normal(size=(1000, 1))
    slow = np.sin(np.arange(1000) / 60)[:, None]
    r = rows(dataset(np.zeros(1000)))
    short, long = (blocks_of(r, [e]) for e in (white, slow))
    assert len(long.edges) < len(short.edges) / 5
    assert sum(b - a for _, a, b in short.edges) == r.count


def test_a_halved_error_is_a_reduction_by_half() -> None:
    e = np.random.default_rng(0).normal(size=(1000, 1))
    r = rows(dataset(np.zeros(1000)))
    change = reduction(blocks_of(r, [e]), 0, [e], [0.5 * e])
    assert (change.value, change.low, change.high) == pytest.approx((0.5, 0.5, 0.5))


def test_each_role_has_its_own_hypotheses() -> None:
    """A sensor does not leak, an actuator does not lose its sign, and a flow may have a store behind it."""
    model = tank()
    seen = {
        "heater": np.linspace(0.0, 2000.0, 50),
        "heat_loss": np.linspace(0.0, 900.0, 50),
        "thermometer": np.linspace(290.0, 310.0, 50),
    }
    drivers = {"power": np.linspace(0.0, 2500.0, 50), "temperature": np.linspace(290.0, 310.0, 50)}
    kinds: dict[str, set[str]] = {}
    for h in hypotheses(model, seen, drivers, 20.0, 10_000.0):
        kinds.setdefault(h.site, set()).add(h.kind)
    assert kinds["heater"] == {"stuck", "leaks", "range", "gain", "offset"}
    assert kinds["thermometer"] == {"stuck", "sign", "lag", "span", "offset"}
    assert kinds["heat_loss"] == {"gain", "depends", "store"}


def test_a_part_with_an_effect_of_that_kind_is_not_asked_again() -> None:
    from tests.discovery.hypotheses.tank import DRAUGHT

    seen = {name: np.linspace(1.0, 2.0, 50) for name in ("heater", "heat_loss", "thermometer")}
    for model, asked in ((tank(), True), (tank().with_effects([DRAUGHT]), False)):
        labels = {h.label for h in hypotheses(model, seen, {}, 20.0, 10_000.0)}
        assert ("heat_loss gain" in labels) is asked


def test_constants_start_from_their_own_values_too() -> None:
    model = tank()
    loose = loose_constants(model.with_parameters({"loss": 200.0}), ["efficiency", "loss"])
    first = scattered_starts(model, loose)[0]
    assert loose.mean + loose.root @ first == pytest.approx([0.8, 60.0])
