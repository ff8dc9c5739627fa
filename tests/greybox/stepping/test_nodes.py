"""Fewer instants: the run from node to node is that of every row, and its derivatives are too."""

from __future__ import annotations

from dataclasses import replace
from math import factorial

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.fast_step import closed_phi
from adaptive_flot.greybox.stepping.graded_nodes import graded_nodes
from adaptive_flot.greybox.stepping.nodes import Nodes, place_nodes, substeps
from adaptive_flot.greybox.stepping.record import RecordSimulator
from adaptive_flot.processes import flotation
from tests.discovery.heated import heated_tank, tank_record

ROWS = 200


def _record(seed: int, rows: int = ROWS) -> Dataset:
    """Inputs that move now and then, never at an even pace."""
    rng = np.random.default_rng(seed)
    levels = np.cumsum(rng.random((rows, 2)) < 0.05, axis=0)
    inputs: FloatArray = np.column_stack([1000.0 + 37.0 * levels[:, 0], 10.0 + levels[:, 1]]).astype(np.float64)
    return Dataset("moves", np.arange(2.0, 2.0 * rows + 1, 2.0), 2.0, inputs, np.zeros((rows, 1)))


@given(st.integers(0, 1000), st.integers(2, 6), st.floats(0.1, 1.0))
def test_nodes_stand_at_every_move_and_at_both_ends(seed: int, longest: int, growth: float) -> None:
    record = _record(seed)
    nodes = place_nodes(record, longest, growth)
    moved = 1 + np.flatnonzero((np.diff(record.inputs, axis=0) != 0).any(axis=1))
    assert {0, ROWS - 1, *moved, *(moved - 1)} <= set(nodes.rows.tolist())
    assert 1 <= np.diff(nodes.rows).min() and np.diff(nodes.rows).max() <= longest
    assert np.sum(nodes.inputs[:, -1]) == pytest.approx(record.time[-1] - record.time[0])


def test_nodes_move_apart_as_what_a_move_set_off_dies_away() -> None:
    still = Dataset("still", np.arange(60.0), 1.0, np.ones((60, 1)), np.zeros((60, 1)))
    assert place_nodes(still, 6, 0.5).rows[:8].tolist() == [0, 1, 2, 4, 7, 11, 17, 23]
    assert place_nodes(still, 3, 1.0).rows[:6].tolist() == [0, 1, 3, 6, 9, 12]


@given(st.integers(0, 1000))
def test_rows_between_nodes_are_cubics_that_do_not_reach_across_a_move(seed: int) -> None:
    """A cubic comes back exactly between two moves, whatever happens beyond them."""
    record = _record(seed)
    nodes = place_nodes(record, 6)
    t = np.arange(ROWS) / ROWS
    part = np.cumsum(np.concatenate([[0], (np.diff(record.inputs, axis=0) != 0).any(axis=1)]))
    values = 1 + t - 2 * t**2 + 3 * t**3 + 100.0 * part  # a jump at every move
    np.testing.assert_allclose(nodes.spread(values[nodes.rows]), values, rtol=1e-9)


@given(st.integers(0, 1000))
def test_means_over_intervals_keep_the_sum(seed: int) -> None:
    record = _record(seed)
    nodes: Nodes = place_nodes(record, 6)
    values = np.random.default_rng(seed).standard_normal((ROWS, 3))
    sums = nodes.means(values) * np.diff(nodes.rows)[:, None]
    np.testing.assert_allclose(sums.sum(axis=0), values[1:].sum(axis=0), atol=1e-9)


def test_a_run_over_nodes_and_its_derivatives_are_those_of_every_row() -> None:
    """The inputs stand still between nodes, so nothing but the interpolation differs."""
    record, model = tank_record(), heated_tank()
    x0, p, wrt = np.array([305.0]), model.parameter_values, ("efficiency", "loss")
    nodes = place_nodes(record, 4, 1.0)
    assert len(nodes.rows) < 0.6 * len(record)
    every, some = RecordSimulator(model, record.dt), RecordSimulator(model, record.dt, nodes)
    np.testing.assert_allclose(some.outputs(record, x0, p), every.outputs(record, x0, p), atol=1e-3)
    gradient = np.hstack([np.zeros((1, 2)), np.ones((1, 1))])
    a, b = (s.sensitivities(record, x0, p, wrt, gradient) for s in (some, every))
    np.testing.assert_allclose(a[0], b[0], atol=1e-3)
    np.testing.assert_allclose(a[1], b[1], atol=1e-3 * np.abs(b[1]).max())
    np.testing.assert_allclose(a[2], b[2], rtol=1e-4)


@given(st.floats(-60.0, 0.0))
def test_weights_of_a_long_step_are_those_of_the_definition(z: float) -> None:
    """phi_k(z) = integral of exp((1 - s) z) s^(k - 1) / (k - 1)! over s from 0 to 1 (Cox & Matthews 2002)."""
    x = ca.SX.sym("x")
    found = [float(v) for v in ca.Function("phi", [x], [*closed_phi(x)])(z)]

    def phi(k: int, at: float) -> float:
        return float(quad(lambda s: np.exp((1 - s) * at) * s ** (k - 1) / factorial(k - 1), 0, 1, epsabs=1e-13)[0])

    np.testing.assert_allclose(found, [phi(1, z), phi(2, z), phi(3, z), phi(1, z / 2)], rtol=1e-9, atol=1e-13)


def test_a_cell_with_fast_bubbles_runs_alike_over_nodes_and_rows() -> None:
    """Bubbles twice as large leave the pulp in half a second: a step of six seconds is a dozen time constants."""
    cell = flotation.make_model()
    large = cell.with_effects([Effect("bubble_size", "constant", "shift", {"amplitude": float(np.log(2.0))})])
    held = np.array([[2.0e-3, 1.7e-4, 0.36], [1.4e-3, 1.7e-4, 0.36], [1.8e-3, 2.0e-4, 0.38]])
    inputs = np.repeat(held, 100, axis=0)
    record = Dataset("cell", np.arange(1.0, 301.0), 1.0, inputs, np.zeros((300, len(cell.outputs))))
    x0 = steady_state(cell, inputs[0], cell.parameter_values).state
    every, some = (RecordSimulator(large, 1.0, n) for n in (None, place_nodes(record, 6)))
    p = large.parameter_values
    a, b = every.outputs(record, x0, p), some.outputs(record, x0, p)
    settled = np.ones(300, dtype=bool)
    for start in (0, 100, 200):
        settled[start : start + 4] = False  # right after a move bubbles and level loop are quicker than the cubics
    scale = np.ptp(a, axis=0)
    assert np.max(np.abs(a - b)[settled] / scale) < 2e-2
    assert np.max(np.abs(a - b)[-1] / scale) < 2e-3


def test_a_run_over_the_parts_of_coarse_rows_is_that_of_the_rows() -> None:
    """Three steps a row as nodes, and the same three by the step of the interval."""
    record, model = tank_record(rows=60), replace(heated_tank(), max_step_s=10.0)
    nodes = substeps(record, 3)
    x0, p, wrt = np.array([305.0]), model.parameter_values, ("efficiency", "loss")
    gradient = np.hstack([np.zeros((1, 2)), np.ones((1, 1))])
    some, every = RecordSimulator(model, record.dt, nodes), RecordSimulator(model, record.dt)
    assert len(nodes.times) == len(nodes.rows) == 3 * 59 + 1
    np.testing.assert_allclose(nodes.times[::3], record.time)
    for a, b in zip(*(run.sensitivities(record, x0, p, wrt, gradient) for run in (some, every)), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-12)
    held = nodes.means(record.inputs)
    np.testing.assert_array_equal(held, nodes.inputs[:, :-1])


@settings(max_examples=15)
@given(st.integers(2, 12), st.integers(1, 3), st.integers(1, 6), st.sampled_from([0.0, 0.3, 1.0]), st.integers(0, 50))
def test_graded_nodes_cover_the_record_and_cross_no_move(
    first: int, least: int, longest: int, growth: float, seed: int
) -> None:
    """Steps add up to the record, every row is there or between two nodes of one rest, and straight lines stay so."""
    record = tank_record(rows=80, seed=seed)
    nodes = graded_nodes(record, first, least, longest, growth)
    assert nodes.inputs[:, -1].sum() == pytest.approx(79 * record.dt)
    np.testing.assert_allclose(nodes.spread(nodes.times), record.time, rtol=1e-12)
    np.testing.assert_allclose(nodes.means(record.inputs), nodes.inputs[:, :-1])
    for a, b in zip(nodes.rows[:-1], nodes.ends, strict=True):
        assert (record.inputs[a + 1 : b + 1] == record.inputs[b]).all()
    if longest == 1 or least > 1:
        assert set(nodes.rows.tolist()) == set(range(80))
    assert (np.bincount(nodes.rows[:-1]) >= least)[np.unique(nodes.rows[:-1])].all()


def test_steps_are_short_after_a_move_and_long_at_rest() -> None:
    """Graded steps give the run of the finest, row by row, with fewer steps."""
    record, model = tank_record(rows=60), replace(heated_tank(), max_step_s=10.0)
    nodes = graded_nodes(record, 6, 1, 3, 0.3)
    moved = np.flatnonzero((np.diff(record.inputs, axis=0) != 0).any(axis=1))
    for k in moved:
        assert (nodes.rows == k).sum() == 6
    assert np.max(nodes.inputs[:, -1]) == 3 * record.dt
    x0, p = np.array([305.0]), model.parameter_values
    run = RecordSimulator(model, record.dt, nodes).outputs(record, x0, p)
    finest = RecordSimulator(model, record.dt, substeps(record, 6)).outputs(record, x0, p)
    np.testing.assert_allclose(run, finest, rtol=1e-5)
    assert len(nodes.rows) < 0.4 * (6 * 59)
