"""The map over one interval and over records: known solutions, exact sensitivities, time convention."""

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray, Model, Scope
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.greybox.stepping.rows import CHUNK
from adaptive_flot.greybox.stepping.stepper import MOST_UNROLLED, Stepper

NAMES = ["n", "C", "floatability.quartz"]


def random_inputs(rows: int, seed: int) -> FloatArray:
    """Air, feed and level set-point held for 20 s each, within the range of the cell."""
    rng = np.random.default_rng(seed)
    held = rng.uniform([9.05e-4, 1.4e-4, 0.34], [2.17e-3, 2.0e-4, 0.42], (rows // 20 + 1, 3))
    return np.repeat(held, 20, axis=0)[:rows]


def central(function: Callable[[FloatArray], FloatArray], x: FloatArray, relative: float = 1e-5) -> FloatArray:
    """Central differences of a function of a vector, the derivative on the last axis."""
    columns = []
    for i in range(x.size):
        h = np.zeros(x.size)
        h[i] = relative * abs(x[i])
        columns.append((function(x + h) - function(x - h)) / (2 * h[i]))
    return np.stack(columns, axis=-1)


def assert_close(gradient: FloatArray, expected: FloatArray, tolerance: float) -> None:
    """Column by column, relative to the largest entry of each."""
    largest = np.abs(expected).reshape(-1, expected.shape[-1]).max(axis=0)
    error = np.abs(gradient - expected).reshape(-1, expected.shape[-1]).max(axis=0)
    assert np.any(largest > 0)
    assert np.all(error <= tolerance * largest), error / largest


@pytest.fixture(scope="module")
def start(model: Model) -> FloatArray:
    return steady_state(model, np.array([1.5e-3, 1.67e-4, 0.38])).state


# -- known solutions ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("accurate", "tolerance"), [(False, 1e-8), (True, 1e-9)])
def test_equations_that_depend_on_time(clock: Model, accurate: bool, tolerance: float) -> None:
    """The right-hand side sees the time inside the interval, the output the time at its end, from any t0."""
    t0, x0, u = 0.7, 1.5, np.linspace(-1, 1, 40)[:, None]
    run = Stepper(clock, 0.5, substeps=8, accurate=accurate).simulate(np.array([x0]), u, np.array([2.0]), t0)
    time = t0 + 0.5 * np.arange(1, 41)
    x = x0 + 2.0 * (np.sin(time) - np.sin(t0)) + 0.5 * np.cumsum(u)
    np.testing.assert_allclose(run.time, time, rtol=1e-14)
    np.testing.assert_allclose(run.states[:, 0], x, atol=tolerance)
    np.testing.assert_allclose(run.outputs[:, 0], x + time, atol=tolerance)


@pytest.mark.parametrize("accurate", [False, True])
def test_algebraic_loop_with_two_unknowns(two_unknowns: Model, accurate: bool) -> None:
    stepper = Stepper(two_unknowns, 0.1, substeps=3, accurate=accurate)
    run = stepper.simulate(np.array([2.0]), np.zeros((50, 1)), np.array([0.5]))
    expected = (2.0**-0.5 + 0.5 * run.time / 2) ** -2
    np.testing.assert_allclose(run.states[:, 0], expected, rtol=1e-8)
    np.testing.assert_allclose(run.outputs[:, 0], expected, rtol=1e-8)


def test_sensitivities_through_two_unknowns_and_time(two_unknowns: Model, clock: Model) -> None:
    """Analytic: dx/dk and dx/dx0 of both known solutions."""
    t = 0.1 * np.arange(1, 51)
    found = Stepper(two_unknowns, 0.1, substeps=3).simulate_sensitivities(
        np.array([2.0]), np.zeros((50, 1)), np.array([0.5]), ["k"], np.array([[0.0, 1.0]])
    )
    root = 2.0**-0.5 + 0.5 * t / 2
    np.testing.assert_allclose(found.gradient[:, 0], np.stack([-t * root**-3, (root * 2.0**0.5) ** -3], 1), rtol=1e-7)
    timed = Stepper(clock, 0.1, substeps=3).simulate_sensitivities(
        np.array([1.0]), np.zeros((50, 1)), np.array([2.0]), ["k"], np.array([[0.0, 1.0]]), t0=0.7
    )
    expected = np.stack([np.sin(0.7 + t) - np.sin(0.7), np.ones(50)], 1)
    np.testing.assert_allclose(timed.gradient[:, 0], expected, atol=1e-8)


# -- records -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rows", [1, CHUNK, 2 * CHUNK + 300])
@pytest.mark.parametrize("varying", [False, True], ids=["one parameter vector", "one a row"])
def test_record_is_the_chain_of_its_steps(clock: Model, rows: int, varying: bool) -> None:
    """However a long record is cut: state, time, inputs and parameters go on across the cuts."""
    stepper = Stepper(clock, 0.5)
    rng = np.random.default_rng(rows)
    u, p = rng.normal(size=(rows, 1)), rng.uniform(1, 3, (rows, 1))
    if not varying:
        p[:] = p[0]
    run = stepper.simulate(np.array([0.3]), u, p if varying else p[0], t0=2.0)
    x = np.array([0.3])
    for k in range(rows):
        x, y, _ = stepper.call(x, 2.0 + 0.5 * k, u[k], p[k])
        np.testing.assert_allclose([run.states[k, 0], run.outputs[k, 0]], [x[0], y[0]], rtol=1e-12)


def test_record_of_the_cell_is_the_chain_of_its_steps(fast: Stepper, model: Model, start: FloatArray) -> None:
    """Vectors of every length in the right order, parameters that differ row by row, signals too."""
    u = random_inputs(30, seed=3)
    p = model.parameter_values * np.random.default_rng(4).uniform(0.99, 1.01, (30, len(model.parameters)))
    run = fast.simulate(start, u, p)
    x = start
    for k in range(30):
        x, y, s = fast.call(x, float(k), u[k], p[k])
        for found, step in ((run.states, x), (run.outputs, y), (run.signals, s)):
            np.testing.assert_allclose(found[k], step, rtol=1e-12)


def test_outputs_at_an_instant_are_those_of_the_step_that_ends_there(fast: Stepper, start: FloatArray) -> None:
    """The first row of a table holds outputs and signals, in that order, from its own state and inputs."""
    u, p = random_inputs(1, seed=5), fast.model.parameter_values
    run = fast.simulate(start, u)
    row = fast.outputs_at(run.states[0], run.time[0], u[0], p)
    np.testing.assert_allclose(row, np.concatenate([run.outputs[0], run.signals[0]]), rtol=1e-12)


def test_simulation_leaves_its_arguments_alone(fast: Stepper, start: FloatArray) -> None:
    u, p, x0 = random_inputs(5, seed=6), fast.model.parameter_values, start.copy()
    copies = u.copy(), p.copy(), x0.copy()
    fast.simulate(x0, u, p).states[:] = 0
    for argument, copy in zip((u, p, x0), copies, strict=True):
        np.testing.assert_array_equal(argument, copy)


def test_state_that_leaves_the_model_shows_as_nan(fast: Stepper, start: FloatArray) -> None:
    """Far too little air: the froth no longer overflows. No exception, no warning."""
    u = np.vstack([np.tile([1.5e-3, 1.67e-4, 0.38], (3, 1)), np.tile([5e-6, 1.67e-4, 0.38], (20, 1))])
    run = fast.simulate(start, u)
    assert np.isfinite(run.states[:3]).all()
    assert np.isnan(run.states[-1]).any()


def test_state_that_leaves_the_model_shows_as_nan_in_the_accurate_step(accurate: Stepper, start: FloatArray) -> None:
    run = accurate.simulate(start, np.tile([5e-6, 1.67e-4, 0.38], (20, 1)))
    assert np.isnan(run.states[-1]).any()


# -- sensitivities -----------------------------------------------------------------------------------------------------


def test_one_step_gradient(fast: Stepper, model: Model, start: FloatArray) -> None:
    """d(outputs)/d(parameters) over one interval with the state held, against central differences."""
    x = start * np.random.default_rng(7).uniform(0.97, 1.03, start.size)
    u, p, i = np.array([1.9e-3, 1.5e-4, 0.36]), model.parameter_values, model.indices("parameters", NAMES)

    def output(theta: FloatArray) -> FloatArray:
        q = p.copy()
        q[i] = theta
        return fast.call(x, 0.0, u, q)[1]

    x_next, y, dy = FastCall(fast.one_step_gradient(NAMES))(x, 0.0, u, p)
    np.testing.assert_allclose(x_next, fast.call(x, 0.0, u, p)[0], rtol=1e-12)
    np.testing.assert_allclose(y, output(p[i]), rtol=1e-12)
    assert_close(dy, central(output, p[i]), 1e-7)


def test_one_step_jacobians(fast: Stepper, model: Model, start: FloatArray) -> None:
    """All four blocks against central differences; the same step; the same gradient as `one_step_gradient`."""
    x = start * np.random.default_rng(8).uniform(0.97, 1.03, start.size)
    u, p, i = np.array([1.2e-3, 1.8e-4, 0.40]), model.parameter_values, model.indices("parameters", NAMES)
    x_next, y, dx_dx, dx_dp, dy_dx, dy_dp = FastCall(fast.one_step_jacobians(NAMES))(x, 0.0, u, p)
    np.testing.assert_allclose(np.append(x_next, y), np.concatenate(fast.call(x, 0.0, u, p)[:2]), rtol=1e-12)

    def both(unknowns: FloatArray) -> FloatArray:
        q = p.copy()
        q[i] = unknowns[9:]
        return np.concatenate(fast.call(unknowns[:9], 0.0, u, q)[:2])

    expected = central(both, np.append(x, p[i]))
    assert_close(np.vstack([dx_dx, dy_dx]) / np.append(x, y)[:, None], expected[:, :9] / np.append(x, y)[:, None], 1e-6)
    assert_close(np.vstack([dx_dp, dy_dp]) / np.append(x, y)[:, None], expected[:, 9:] / np.append(x, y)[:, None], 1e-6)
    np.testing.assert_allclose(FastCall(fast.one_step_gradient(NAMES))(x, 0.0, u, p)[2], dy_dp, rtol=1e-10, atol=1e-14)


def test_sensitivities_over_a_whole_record(fast: Stepper, model: Model, start: FloatArray) -> None:
    """They carry the past along: against central differences of the whole simulation, for parameters and for x0."""
    u, p, i = random_inputs(200, seed=9), model.parameter_values, model.indices("parameters", NAMES)
    free = [1, 3, 4, 8]  # level, gangue, smallest and largest bubbles
    x0_gradient = np.zeros((9, 7))
    x0_gradient[free, 3 + np.arange(4)] = 1.0

    def run(unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
        q, x0 = p.copy(), start.copy()
        q[i], x0[free] = unknowns[:3], unknowns[3:]
        found = fast.simulate(x0, u, q)
        return found.outputs, found.states[-1]

    unknowns = np.append(p[i], start[free])
    outputs, last = run(unknowns)
    found = fast.simulate_sensitivities(start, u, p, NAMES, x0_gradient)
    np.testing.assert_allclose(found.outputs, outputs, rtol=1e-12)
    np.testing.assert_allclose(found.last_state, last, rtol=1e-12)
    for j in range(len(model.outputs)):
        assert_close(found.gradient[:, j], central(lambda v, j=j: run(v)[0][:, j], unknowns), 1e-5)  # type: ignore[misc]
    scale = last[:, None]
    assert_close(found.last_state_gradient / scale, central(lambda v: run(v)[1], unknowns) / scale, 1e-4)


def test_sensitivities_go_on_across_the_cuts_of_a_long_record(clock: Model) -> None:
    """dx/dk = sin t - sin t0 and dx/dx0 = 1 beyond one chunk; a gradient of x0 on a parameter is added."""
    rows = CHUNK + 200
    found = Stepper(clock, 0.1).simulate_sensitivities(
        np.array([1.0]), np.zeros((rows, 1)), np.array([2.0]), ["k"], np.array([[0.25, 1.0]]), t0=0.7
    )
    t = 0.7 + 0.1 * np.arange(1, rows + 1)
    expected = np.stack([0.25 + np.sin(t) - np.sin(0.7), np.ones(rows)], 1)
    np.testing.assert_allclose(found.gradient[:, 0], expected, atol=1e-8)
    np.testing.assert_allclose(found.last_state_gradient[0], expected[-1], atol=1e-8)


def test_two_sets_of_unknowns_do_not_share_compiled_functions(fast: Stepper, start: FloatArray) -> None:
    """The same stepper asked for n, then for C, gives each its own gradient."""
    u, p = random_inputs(20, seed=10), fast.model.parameter_values
    both = fast.simulate_sensitivities(start, u, p, ["n", "C"], np.zeros((9, 2))).gradient
    for j, name in enumerate(("n", "C")):
        alone = fast.simulate_sensitivities(start, u, p, [name], np.zeros((9, 1))).gradient
        np.testing.assert_allclose(alone[..., 0], both[..., j], rtol=1e-10, atol=1e-14)


def test_steppers_of_one_model_share_functions_and_those_of_others_do_not(clock: Model) -> None:
    """Shared by interval, substeps and method only; a copy of the model with other equations starts with none."""
    one = Stepper(clock, 0.5)
    assert one.step is Stepper(clock, 0.5).step
    others = (Stepper(clock, 0.25), Stepper(clock, 0.5, substeps=3), Stepper(clock, 0.5, accurate=True))
    assert all(one.step is not other.step for other in others)

    def doubled(m: Scope) -> None:
        m.derivative("x", 2 * m.parameter("k") * ca.cos(m.time) + m.input("u"))
        m.output("y", m.state("x") + m.time)

    arguments = np.array([1.0]), 0.0, np.array([0.0]), np.array([2.0])
    (first, *_), (second, *_) = one.call(*arguments), Stepper(replace(clock, equations=doubled), 0.5).call(*arguments)
    np.testing.assert_allclose([first[0] - 1, second[0] - 1], [2 * np.sin(0.5), 4 * np.sin(0.5)], rtol=1e-4)


# -- misuse ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("dt", "substeps"), [(0.0, 3), (-1.0, 3), (float("nan"), 3), (float("inf"), 3), (1.0, 0)])
def test_interval_and_substeps_must_be_positive(clock: Model, dt: float, substeps: int) -> None:
    with pytest.raises(ModelError, match="dt > 0 and substeps >= 1"):
        Stepper(clock, dt, substeps=substeps)


def test_accurate_step_has_no_sensitivities(accurate: Stepper) -> None:
    """Refused, not wrong: the reverse-mode gradient of IDAS is off by up to 5e-3."""
    with pytest.raises(ModelError, match="accurate=False"):
        accurate.one_step_gradient(["n"])


def test_wrong_shapes_are_named(fast: Stepper, start: FloatArray) -> None:
    u, p = random_inputs(4, seed=11), fast.model.parameter_values
    with pytest.raises(ModelError, match="inputs have 2 columns, model 'flotation' 3"):
        fast.simulate(start, u[:, :2])
    with pytest.raises(ModelError, match=r"parameters have shape \(3,\)"):
        fast.simulate(start, u, p[:3])
    with pytest.raises(ModelError, match="one parameter vector for the whole record"):
        fast.simulate_sensitivities(start, u, np.tile(p, (4, 1)), ["n"], np.zeros((9, 1)))


def test_initial_state_of_one_element_is_refused(fast: Stepper) -> None:
    with pytest.raises(ModelError):
        fast.simulate(np.array([0.1]), random_inputs(3, seed=12))


def test_record_without_rows_is_simulated(fast: Stepper, start: FloatArray) -> None:
    assert fast.simulate(start, np.empty((0, 3))).states.shape == (0, 9)


# -- coarsely sampled records ------------------------------------------------------------------------------------------


def test_a_record_of_many_substeps_a_row_is_that_of_its_rows_one_by_one(model: Model, start: FloatArray) -> None:
    """Ten steps a row, unrolled in one function for a sample, one by one for a record: the same run and derivatives."""
    rows, p = 40, model.parameter_values
    u = random_inputs(200, 3)[::5]
    stepper = Stepper(model, 10.0)
    assert stepper.substeps > MOST_UNROLLED
    run = stepper.simulate(start, u, p, 5.0)
    x, by_sample = start, []
    for k in range(rows):
        x, y, s = stepper.call(x, 5.0 + 10.0 * k, u[k], p)
        by_sample.append(np.concatenate([x, y, s]))
    np.testing.assert_allclose(np.hstack([run.states, run.outputs, run.signals]), by_sample, rtol=1e-9)
    np.testing.assert_allclose(run.time, 15.0 + 10.0 * np.arange(rows))
    by_row = stepper.simulate(start, u, np.tile(p, (rows, 1)), 5.0)
    np.testing.assert_array_equal(by_row.outputs, run.outputs)
    where = model.indices("parameters", NAMES)
    found = stepper.simulate_sensitivities(start, u, p, NAMES, np.zeros((start.size, len(NAMES))), 5.0)
    np.testing.assert_array_equal(found.outputs, run.outputs)

    def outputs(values: FloatArray) -> FloatArray:
        changed = p.copy()
        changed[where] = values
        return stepper.simulate(start, u, changed, 5.0).outputs

    numeric = central(outputs, p[where])
    for j in range(len(model.outputs)):
        if np.abs(numeric[:, j]).max() > 1e-12:
            assert_close(found.gradient[:, j], numeric[:, j], 1e-4)
