"""The filter in innovations form: the textbook's results where these are known."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.discovery.innovations.filter import linear_response
from adaptive_flot.discovery.innovations.filter.linear_response import ResponseFunctions
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox import Dataset, Effect, FloatArray, Model, Parameter, Quantity, Scope, Stepper
from adaptive_flot.greybox.filtering import NoiseModel, RecordFilter, maximise, prediction_errors, smooth
from adaptive_flot.greybox.filtering import filter as filters
from adaptive_flot.greybox.stepping.compiling.compiled import CompileError
from adaptive_flot.greybox.stepping.whole_record import tape_recursion

DT, DECAY = 2.0, 0.05
Q, R = 0.3, 0.5


def _equations(m: Scope) -> None:
    x = m.state("x")
    m.derivative("x", m.parameter("k") * (m.input("u") - x))
    m.output("y", m.site("gauge", x, "sensor", "offset"))


def first_order() -> Model:
    """dx/dt = k (u - x), y = x."""
    return Model(
        name="first-order",
        states=(Quantity("x", "-", "state"),),
        inputs=(Quantity("u", "-", "input"),),
        parameters=(Parameter("k", DECAY, "1/s", "test", lower=1e-3, upper=1.0, scale=0.02, role="estimated"),),
        outputs=(Quantity("y", "-", "output"),),
        equations=_equations,
        max_step_s=0.5,
        starts_steady=False,
    )


def record(rows: int = 400, seed: int = 0, missing: bool = True) -> tuple[Dataset, FloatArray]:
    """Record of the stochastic model, and its true state."""
    rng = np.random.default_rng(seed)
    a = math.exp(-DECAY * DT)
    u: FloatArray = np.repeat(rng.normal(0.0, 3.0, rows // 20 + 1), 20)[:rows]
    x = np.zeros(rows)
    for k in range(1, rows):
        x[k] = a * (x[k - 1] + Q * math.sqrt(DT) * rng.normal()) + (1 - a) * u[k]
    y = x + R * rng.normal(size=rows)
    if missing:
        y[50:60] = np.nan
    return Dataset("toy", DT * np.arange(rows, dtype=float), DT, u[:, None], y[:, None]), x


def kalman(data: Dataset, P0: float) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Scalar Kalman filter with the process noise at the start of an interval, written out once more."""
    a, b = math.exp(-DECAY * DT), 1 - math.exp(-DECAY * DT)
    z, P, total = 0.0, P0, 0.0
    means, variances, predicted = [], [], []
    for k, (u, y) in enumerate(zip(data.inputs[:, 0], data.outputs[:, 0], strict=True)):
        if k:
            z, P = a * z + b * u, a * a * (P + Q * Q * DT)
        predicted.append(z)
        if np.isfinite(y):
            S = P + R * R
            total -= (math.log(2 * math.pi * S) + (y - z) ** 2 / S) / 2
            z, P = z + P / S * (y - z), P - P * P / S
        means.append(z)
        variances.append(P)
    return np.array(means), np.array(variances), np.array(predicted), total


NOISE = NoiseModel({"x": Q}, {"y": R}, degrees_of_freedom=math.inf)


def test_gaussian_filter_is_the_kalman_filter() -> None:
    """On a linear model means, variances, predictions and likelihood are those of the textbook's recursion."""
    data, _ = record()
    filtered = RecordFilter(first_order(), DT, [0], (), math.inf).run(
        data, NOISE, np.zeros(1), np.eye(1), np.array([DECAY])
    )
    means, variances, predicted, total = kalman(data, 1.0)
    np.testing.assert_allclose(filtered.z[:, 0], means, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(filtered.P[:, 0, 0], variances, rtol=1e-6)
    np.testing.assert_allclose(filtered.predicted[:, 0], predicted, rtol=1e-6, atol=1e-6)
    assert filtered.log_likelihood.sum() == pytest.approx(total, rel=1e-6)


@pytest.mark.parametrize(("rows", "library"), [(1, True), (400, True), (400, False)])
def test_likelihoods_of_several_cases_are_those_of_each_alone(
    monkeypatch: pytest.MonkeyPatch, rows: int, library: bool
) -> None:
    """To the last bit, with missing outputs, and noise, start and parameters of its own for each."""

    one = tape_recursion._library

    def none(lanes: int) -> Any:
        if lanes == 1:
            return one(1)
        raise CompileError("the disk is full")

    if not library:
        monkeypatch.setattr(tape_recursion, "_library", none)
    data, _ = record(rows)
    own = RecordFilter(first_order(), DT, [0])
    cases = [
        (NoiseModel({"x": Q * k}, {"y": R / k}), np.full(1, k - 1.0), k * np.eye(1), np.array([DECAY * k]))
        for k in np.linspace(0.5, 2.0, 11)
    ]
    each = [own.run(data, *case).log_likelihood for case in cases]
    np.testing.assert_array_equal(own.log_likelihoods(data, cases), each)
    np.testing.assert_array_equal(own.log_likelihoods(data, cases[:1]), each[:1])
    assert own.log_likelihoods(data, []).shape == (0, rows)


def test_smoother_is_the_least_squares_solution() -> None:
    """Smoothed states are the solution of the whole weighted least-squares problem, solved at once."""
    data, _ = record(rows=60, missing=False)
    n, a, b = 60, math.exp(-DECAY * DT), 1 - math.exp(-DECAY * DT)
    filtered = RecordFilter(first_order(), DT, [0], (), math.inf).run(
        data, NOISE, np.zeros(1), np.eye(1), np.array([DECAY])
    )
    rows, right = [np.eye(n)[0]], [0.0]
    for k in range(n):
        rows.append(np.eye(n)[k] / R)
        right.append(data.outputs[k, 0] / R)
    for k in range(1, n):
        size = a * Q * math.sqrt(DT)
        rows.append((np.eye(n)[k] - a * np.eye(n)[k - 1]) / size)
        right.append(b * data.inputs[k, 0] / size)
    A = np.array(rows)
    expected = np.linalg.solve(A.T @ A, A.T @ np.array(right))
    smoothed = smooth(filtered)
    np.testing.assert_allclose(smoothed.z[:, 0], expected, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(smoothed.std()[:, 0] ** 2, np.diag(np.linalg.inv(A.T @ A)), rtol=1e-5)


def test_students_t_hardly_follows_one_absurd_value() -> None:
    """A value a hundred deviations off moves the Gaussian filter by far more than the one with heavy tails."""
    data, _ = record(missing=False)
    spoilt = data.outputs.copy()
    spoilt[200] += 100 * R
    bad = Dataset(data.name, data.time, DT, data.inputs, spoilt)
    moved = {}
    for nu in (5.0, math.inf):
        own = RecordFilter(first_order(), DT, [0], (), nu)
        both = [own.run(d, NOISE, np.zeros(1), np.eye(1), np.array([DECAY])).z[200, 0] for d in (data, bad)]
        moved[nu] = abs(both[1] - both[0])
    assert moved[math.inf] > 20 * moved[5.0]


def test_maximum_likelihood_finds_noise_and_parameter() -> None:
    """Process noise, measurement noise and the rate come out within what 1500 rows allow."""
    data, _ = record(rows=1500, seed=3, missing=False)
    start = NoiseModel({"x": 0.05}, {"y": 0.1}, degrees_of_freedom=math.inf)
    fit = maximise(first_order(), [data], start, free=["k"])
    assert fit.noise.process["x"] == pytest.approx(Q, rel=0.25)
    assert fit.noise.measurement["y"] == pytest.approx(R, rel=0.1)
    assert fit.parameters[0] == pytest.approx(DECAY, rel=0.25)


def test_two_records_have_an_initial_state_each() -> None:
    """The likelihood of two records is the sum of their own: nothing is carried across their border."""
    one, two = record(seed=1)[0], record(seed=2)[0]
    both, single = (
        maximise(first_order(), records, NOISE, estimate_process=False, estimate_measurement=False)
        for records in ([one, two], [one])
    )
    other = maximise(first_order(), [two], NOISE, estimate_process=False, estimate_measurement=False)
    assert both.log_likelihood == pytest.approx(single.log_likelihood + other.log_likelihood, rel=1e-12)


def test_errors_one_step_ahead_are_the_innovations() -> None:
    """With a horizon of one row the prediction errors are measured minus predicted."""
    data, _ = record()
    model = first_order()
    filtered = RecordFilter(model, DT, [0], (), math.inf).run(data, NOISE, np.zeros(1), np.eye(1), np.array([DECAY]))
    errors = prediction_errors(Stepper(model, DT), data, filtered, [0], (), np.array([DECAY]), 1)
    np.testing.assert_allclose(errors[1:], (data.outputs - filtered.predicted)[1:], rtol=1e-9, atol=1e-9)


def test_walking_parameter_follows_a_step() -> None:
    """A walk locates the time of a step at a site that the model knows nothing of."""
    data, x = record(rows=600, seed=5, missing=False)
    shifted = data.outputs + np.where(np.arange(600) >= 300, 5.0, 0.0)[:, None]
    walking = first_order().with_effects([Effect("gauge", "constant", "shift")])
    name = walking.effects[0].parameter("amplitude")
    noise = NoiseModel({"x": Q}, {"y": R}, {name: 0.2})
    fit = maximise(
        walking,
        [Dataset("step", data.time, DT, data.inputs, shifted)],
        noise,
        estimate_process=False,
        estimate_measurement=False,
    )
    course = smooth(fit.filtered[0]).z[:, 1]
    assert np.mean(course[400:]) - np.mean(course[:200]) == pytest.approx(5.0, abs=1.0)
    assert abs(int(np.argmax(np.diff(course))) - 300) <= 5
    assert x.shape == (600,)


def test_wrong_shape_is_told() -> None:
    """A start that does not fit the model is a named error."""
    data, _ = record(rows=30)
    with pytest.raises(ModelError, match="z0"):
        RecordFilter(first_order(), DT, [0]).run(data, NOISE, np.zeros(3), np.eye(3), np.array([DECAY]))


def test_a_hidden_state_that_starts_far_off_is_found_beside_outliers_that_are_not_believed() -> None:
    """Behind a lag of ten rows, with Student's t: the error stays within what the covariance says."""
    late = Effect("gauge", "lag", "lag", {"amplitude": 1.0, "time_constant": 10 * DT}, {"scale": 1.0})
    model = first_order().with_effects([late])
    data, x = record(missing=False)
    shown, follow = np.zeros(len(x)), 1 - math.exp(-1 / 10)
    for k in range(1, len(x)):
        shown[k] = shown[k - 1] + follow * (x[k] - shown[k - 1])
    y = shown + 0.01 * np.random.default_rng(1).normal(size=len(x))
    y[100] += 5.0
    data = Dataset("late", data.time, DT, data.inputs, y[:, None])
    noise = NoiseModel({"x": Q}, {"y": 0.01})
    filtered = RecordFilter(model, DT, [0]).run(
        data, noise, np.array([20.0, 0.0]), np.diag([100.0, 1.0]), model.parameter_values
    )
    distance = np.abs(filtered.z[:, 0] - x) / np.sqrt(filtered.P[:, 0, 0])
    assert np.mean(distance[20:] < 3.0) > 0.95


@pytest.mark.parametrize("power", [1.0, 0.5])
def test_steps_as_a_loop_are_those_of_one_function(monkeypatch: pytest.MonkeyPatch, power: float) -> None:
    """Sixteen steps an interval, with a constant that is fitted, for one member and for several."""
    data, _ = record(200)
    model = replace(first_order(), max_step_s=DT / 16)
    p = np.array([DECAY * power])
    both = np.array([p[0], 0.2])  # and how much too much the gauge shows
    cases = [(NoiseModel({"x": Q * k}, {"y": R}), np.zeros(1), np.eye(1), both) for k in (0.5, 1.0, 1.5)]

    def runs() -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        fresh = replace(model, name=f"{model.name}-{power}")
        own = ResponseFunctions(fresh, DT, [0], ["gauge"], ["k"], 5.0)
        at = own.at(data, cases[0][0], p, cases[0][1:3])
        run = own.filter.run(data, *cases[0])
        return own.filter.log_likelihoods(data, cases), at.by_constants, run.P, run.H

    in_steps = runs()
    monkeypatch.setattr(filters, "steps_along", lambda *given: None)
    monkeypatch.setattr(linear_response, "steps_along", lambda *given: None)
    for one, other in zip(in_steps, runs(), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-14)


def test_without_a_compiler_the_steps_of_an_interval_are_one_function(monkeypatch: pytest.MonkeyPatch) -> None:
    data, _ = record(150)
    case = NoiseModel({"x": Q}, {"y": R}), np.zeros(1), np.eye(1), np.array([DECAY])

    def run(name: str) -> FloatArray:
        model = replace(first_order(), name=name, max_step_s=DT / 4)
        return RecordFilter(model, DT, [0]).run(data, *case).log_likelihood

    in_steps = run("compiled")

    def none(lanes: int) -> Any:
        raise CompileError("no compiler")

    monkeypatch.setattr(tape_recursion, "_library", none)
    np.testing.assert_allclose(run("interpreted"), in_steps, rtol=1e-12)
