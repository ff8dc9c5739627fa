"""Members of a model simulated side by side are those simulated one by one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.ensemble.ensemble import Ensemble
from adaptive_flot.greybox.ensemble.lane_library import LaneLibrary
from adaptive_flot.greybox.ensemble.one_member import OneMember
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.compiling import compiled as compiled_functions
from adaptive_flot.greybox.stepping.compiling.compiled import compiler_problem
from adaptive_flot.greybox.stepping.stepper import MOST_UNROLLED, Stepper
from adaptive_flot.greybox.stepping.whole_record.instruction_sets import AVX2, AVX512, InstructionSet, supported

PROBLEM = compiler_problem()
needs_compiler = pytest.mark.skipif(PROBLEM is not None, reason=f"nothing can be compiled here: {PROBLEM}")
COMPILED = [
    False,
    pytest.param(
        True, marks=pytest.mark.skipif(PROBLEM is not None, reason=f"nothing can be compiled here: {PROBLEM}")
    ),
]
NAMES = ("growth_exponent", "coalescence_rate")
MEMBERS, ROWS = 11, 60


def cell_members(model: Model) -> tuple[FloatArray, FloatArray, FloatArray]:
    """States, inputs and parameters of members of the cell, each its own."""
    rng = np.random.default_rng(1)
    held = rng.uniform([9.05e-4, 1.4e-4, 0.34], [2.17e-3, 2.0e-4, 0.42], (MEMBERS, 3, 3))
    p = model.parameter_values * rng.uniform(0.97, 1.03, (MEMBERS, len(model.parameters)))
    x = steady_state(model, held[0, 0]).state * rng.uniform(0.99, 1.01, (MEMBERS, len(model.states)))
    return x, np.repeat(held, ROWS // 3, axis=1), p


@pytest.mark.parametrize("compiled", COMPILED)
def test_records_of_the_cell(model: Model, compiled: bool) -> None:
    x, u, p = cell_members(model)
    run = Ensemble(replace(model, compiled=compiled), 1.0).simulate(x, u, p, 7.0)
    plain = Stepper(replace(model, record_code=False), 1.0)
    for m in range(MEMBERS):
        expected = plain.simulate(x[m], u[m], p[m], 7.0)
        np.testing.assert_array_equal(run.time, expected.time)
        for what in ("states", "outputs", "signals"):
            np.testing.assert_allclose(getattr(run, what)[m], getattr(expected, what), rtol=1e-12)
        np.testing.assert_array_equal(run.last_state[m], run.states[m, -1])


@needs_compiler
def test_one_member_is_the_compiled_stepper_to_the_bit(model: Model) -> None:
    """A fit of a compiled model gives the numbers that it gave before, in less time."""
    quick = replace(model, compiled=True)
    x, u, p = cell_members(model)
    one, stepper = OneMember.where_compiled(quick, 1.0), Stepper(quick, 1.0)
    assert one is not None and OneMember.where_compiled(model, 1.0) is None
    found, expected = (s.simulate(x[0], u[0], p[0], 3.0) for s in (one, stepper))
    for what in ("time", "states", "outputs", "signals"):
        np.testing.assert_array_equal(getattr(found, what), getattr(expected, what))
    start = np.ones((len(model.states), 2))
    one_way, other = (s.simulate_sensitivities(x[0], u[0], p[0], NAMES, start, 3.0) for s in (one, stepper))
    for what in ("outputs", "gradient", "last_state", "last_state_gradient"):
        np.testing.assert_array_equal(getattr(one_way, what), getattr(other, what))


@needs_compiler
@pytest.mark.parametrize(("instructions", "name"), [(AVX2, b"_ZGVdN4v_exp"), (AVX512, b"_ZGVeN8v_exp")])
def test_the_step_of_the_cell_is_made_of_vector_instructions(
    model: Model, instructions: InstructionSet, name: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A compiler that makes no vectors of a loop says nothing, and the results are the same: it calls plain `exp`."""
    if instructions not in supported():
        pytest.skip(f"this machine has no {instructions.name}")
    monkeypatch.setattr(compiled_functions, "cache_folder", lambda: tmp_path / "compiled")
    LaneLibrary(Stepper(model, 1.0).step, [0, -1, -1, -1], instructions)
    (library,) = (tmp_path / "compiled").glob("step_lanes-*.so")
    content = library.read_bytes()
    assert name in content and b"\0exp\0" not in content and b"\0pow\0" not in content


@pytest.mark.parametrize("compiled", COMPILED)
def test_sensitivities_of_the_cell(model: Model, compiled: bool) -> None:
    """A direction is compared by its largest entry, as elsewhere: small entries are differences of large ones."""
    x, u, p = cell_members(model)
    q = len(NAMES) + 1
    start = np.zeros((MEMBERS, len(model.states), q))
    start[:, 2, -1] = np.arange(1, MEMBERS + 1)
    found = Ensemble(replace(model, compiled=compiled), 1.0).simulate_sensitivities(x, u, p, NAMES, start)
    plain = Stepper(replace(model, record_code=False), 1.0)
    for m in range(MEMBERS):
        expected = plain.simulate_sensitivities(x[m], u[m], p[m], NAMES, start[m])
        np.testing.assert_allclose(found.outputs[m], expected.outputs, rtol=1e-12)
        np.testing.assert_allclose(found.last_state[m], expected.last_state, rtol=1e-12)
        size = np.abs(expected.gradient).max(axis=0)
        assert np.all(np.abs(found.gradient[m] - expected.gradient) <= 1e-12 * size)
        size = np.abs(expected.last_state_gradient).max(axis=1, keepdims=True)
        assert np.all(np.abs(found.last_state_gradient[m] - expected.last_state_gradient) <= 1e-12 * size)


@pytest.mark.parametrize("substeps", [3, MOST_UNROLLED + 2])
@pytest.mark.parametrize("varying", [False, True])
def test_intervals_of_several_steps_and_parameters_that_change(clock: Model, substeps: int, varying: bool) -> None:
    u, x = np.linspace(-1, 1, 20)[:, None], np.array([[1.0], [2.0], [3.0]])
    p = np.linspace(1, 2, 60).reshape(3, 20, 1) if varying else np.array([[0.5], [1.5], [2.5]])
    run = Ensemble(clock, 0.5, substeps=substeps).simulate(x, u, p, 0.3)
    plain = Stepper(replace(clock, record_code=False), 0.5, substeps=substeps)
    for m in range(3):
        expected = plain.simulate(x[m], u, p[m], 0.3)
        np.testing.assert_allclose(run.states[m], expected.states, rtol=1e-12)
        np.testing.assert_allclose(run.outputs[m], expected.outputs, rtol=1e-12)
    if not varying:
        gradient = np.zeros((1, 1))
        found = Ensemble(clock, 0.5, substeps=substeps).simulate_sensitivities(x, u, p, ("k",), gradient, 0.3)
        one = plain.simulate_sensitivities(x[1], u, p[1], ("k",), gradient, 0.3)
        np.testing.assert_allclose(found.gradient[1], one.gradient, rtol=1e-12)


def test_one_interval_at_a_time_gives_the_record(clock: Model) -> None:
    ensemble, u = Ensemble(clock, 0.5), np.linspace(-1, 1, 10)[:, None]
    x0, p = np.array([[1.0], [2.0]]), np.array([1.5])
    whole = ensemble.simulate(x0, u, p, 0.3)
    x = x0
    for k in range(10):
        x, y, _ = ensemble.step(x, 0.3 + 0.5 * k, u[k], p)
        np.testing.assert_allclose(x, whole.states[:, k], rtol=1e-14)
        np.testing.assert_allclose(y, whole.outputs[:, k], rtol=1e-14)


def test_only_what_is_asked_for_is_kept(clock: Model) -> None:
    run = Ensemble(clock, 0.5).simulate(np.array([[1.0], [2.0]]), np.ones((4, 1)), keep=["outputs"])
    assert (run.outputs.shape, run.states.shape, run.signals.shape) == ((2, 4, 1), (2, 0, 1), (2, 0, 0))
    expected = Stepper(replace(clock, record_code=False), 0.5).simulate(np.array([2.0]), np.ones((4, 1)))
    np.testing.assert_allclose(run.last_state[1], expected.states[-1])


def test_what_does_not_fit_is_said(clock: Model) -> None:
    ensemble, u = Ensemble(clock, 0.5), np.ones((4, 1))
    with pytest.raises(ModelError, match="nothing says how many members"):
        ensemble.simulate(np.ones(1), u, np.ones(1))
    with pytest.raises(ModelError, match=r"\[2, 3\] members"):
        ensemble.simulate(np.ones((2, 1)), u, np.ones((3, 1)))
    with pytest.raises(ModelError, match="'u' has the shape"):
        ensemble.simulate(np.ones((2, 1)), np.ones((4, 2)))
    with pytest.raises(ModelError, match="at least one interval"):
        ensemble.simulate(np.ones((2, 1)), np.ones((0, 1)))
    with pytest.raises(ModelError, match="dt > 0"):
        Ensemble(clock, 0.0)
    with pytest.raises(ModelError, match="one a row"):
        ensemble.simulate_sensitivities(np.ones((2, 1)), u, np.ones((2, 4, 1)), ("k",), np.zeros((1, 1)))
