"""Measured outputs correct the state: the gain, what it is worth where the inputs are wrong, and bad instruments."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.contracts import DelayedValue, Estimate, Prior, Sample, Setup, Status
from adaptive_flot.contracts.delayed_measurements import DelayedMeasurements
from adaptive_flot.greybox.model import FloatArray, Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.stepping.stepper import Stepper
from estimators.ekf import Ekf
from estimators.rpem.estimator import Rpem
from estimators.rpem.full import rpem_full
from estimators.shared.state_correction import StateCorrection
from tests.estimators.conftest import CellCase, replay

MEASURED = {"level": 5e-4, "tails_flow": 5e-7}


def two_tanks() -> Model:
    """Two levels in series, both measured, linear in the state and in the gain g of the inflow."""

    def equations(s: Scope) -> None:
        s.derivative("a", s.parameter("g") * s.input("u") - 0.2 * s.state("a"))
        s.derivative("b", 0.2 * s.state("a") - 0.1 * s.state("b"))
        s.output("ya", s.state("a"))
        s.output("yb", s.state("b"))

    return Model(
        name="two-tanks",
        states=(Quantity("a", "-", "", scale=2.0), Quantity("b", "-", "", scale=3.0)),
        inputs=(Quantity("u", "-", ""),),
        parameters=(Parameter("g", 1.0, "-", "", None, -50.0, 50.0, 1.0),),
        outputs=(Quantity("ya", "-", ""), Quantity("yb", "-", "")),
        equations=equations,
    )


SETUP = Setup(two_tanks(), 1.0, ("g",), ("ya",))
NOISE = {"yb": 0.3}


def tank_samples(rows: int = 150) -> tuple[Sample, ...]:
    generator = np.random.default_rng(8)
    u = generator.uniform(0, 2, size=(rows, 1))
    x, samples = np.array([1.0, 4.0]), []
    for k in range(rows):
        x, y, _ = Stepper(SETUP.model, 1.0).call(
            x + [0.02, 0.03] * generator.normal(size=2), float(k), u[k], np.array([1.4])
        )
        samples.append(Sample(k + 1.0, u[k], y + 0.3 * generator.normal(size=2)))
    return tuple(samples)


def matrices() -> tuple[FloatArray, FloatArray, FloatArray]:
    """A, B (for u) and C of the output yb one interval ahead, read off the step by unit moves."""
    step = Stepper(SETUP.model, 1.0).call

    def end(x: list[float], u: float) -> tuple[FloatArray, FloatArray]:
        tracked = step(np.array(x), 0.0, np.array([u]), np.array([1.0]))
        return tracked[0], tracked[1]

    (a, ya), (b, yb), (c, _) = end([1, 0], 0), end([0, 1], 0), end([0, 0], 1)
    return np.column_stack([a, b]), c, np.array([[ya[1], yb[1]]])


def stationary_gain(state_noise: float) -> FloatArray:
    """The Riccati recursion itself, iterated from zero until it rests."""
    A, _, C = matrices()
    X, Q, R = np.zeros((2, 2)), np.diag((state_noise * np.array([2.0, 3.0])) ** 2), np.array([[NOISE["yb"] ** 2]])
    for _ in range(20_000):
        gain = X @ C.T @ np.linalg.inv(C @ X @ C.T + R)
        X = A @ (X - gain @ C @ X) @ A.T + Q
    return A @ X @ C.T @ np.linalg.inv(C @ X @ C.T + R)


def test_the_gain_is_where_the_riccati_recursion_rests() -> None:
    tracked = StateCorrection(SETUP, NOISE, 0.01).design(np.ones(2), 0.0, np.ones(1), np.ones(1), np.ones(1))
    np.testing.assert_allclose(tracked.gain, stationary_gain(0.01), rtol=1e-8)


def test_with_known_parameters_it_is_the_stationary_kalman_filter() -> None:
    """Sample by sample: x <- A x + B u + K (y - C x - D u); and, once that has settled, the EKF with the same noise."""
    samples, K, (A, B, C) = tank_samples(), stationary_gain(0.01), matrices()
    prior = Prior(0.0, np.array([1.0, 4.0]), np.array([1.4]), np.array([[1e-20]]), np.array([0.3]))
    tracked = replay(Rpem(SETUP, correct_state=NOISE, state_noise=0.01), prior, samples)
    x = prior.state
    for sample, estimate in zip(samples, tracked, strict=True):
        ahead = Stepper(SETUP.model, 1.0).call(np.zeros(2), 0.0, sample.inputs, np.array([1.4]))[1][1]
        x = A @ x + 1.4 * B * sample.inputs + K[:, 0] * (sample.outputs[1] - C[0] @ x - ahead)
        np.testing.assert_allclose(estimate.state, x, rtol=1e-6)
    ekf = Ekf(replace(SETUP, outputs=("yb",)), drift_per_hour=0.0, state_noise=0.01)
    filtered = replay(ekf, replace(prior, noise_std=np.array([NOISE["yb"]])), samples)
    np.testing.assert_allclose(tracked[-1].state, filtered[-1].state, rtol=1e-4)


def test_with_the_full_gradient_it_is_least_squares_on_the_predictor() -> None:
    """The predictor with a fixed gain is linear in g: the recursion must find what its regressors give, to 1e-9."""
    samples, K, sigma = tank_samples(), stationary_gain(0.01), 0.3
    prior = Prior(0.0, np.array([1.0, 4.0]), np.array([0.5]), np.array([[4.0]]), np.array([sigma]))
    options: dict[str, Any] = {"gradient": "recursive", "forgetting": 1.0, "correct_state": NOISE, "state_noise": 0.01}
    tracked = replay(Rpem(SETUP, **options), prior, samples)
    step = Stepper(SETUP.model, 1.0).call
    runs = []
    for g in (0.0, 1.0):
        x, ys = prior.state, []
        for sample in samples:
            ahead, y, _ = step(x, 0.0, sample.inputs, np.array([g]))
            ys.append(y[0])
            x = ahead + K[:, 0] * (sample.outputs[1] - y[1])
        runs.append(np.array(ys))
    psi, y = runs[1] - runs[0], np.array([s.outputs[0] for s in samples]) - runs[0]
    expected = (psi @ y / sigma**2 + 0.5 / 4.0) / (psi @ psi / sigma**2 + 1 / 4.0)
    np.testing.assert_allclose(tracked[-1].parameters[0], expected, rtol=1e-9)


def cell_run(case: CellCase, feed_step: float, **options: Any) -> tuple[list[Estimate], FloatArray]:
    """Estimates and true states where the feed flow is `feed_step` larger than known, level and tails measured."""
    model, generator = case.setup.model, np.random.default_rng(6)
    acting = np.vstack([case.inputs] * 3)
    known = acting.copy()
    acting[30:, 1] *= 1 + feed_step
    truth = Stepper(model, 1.0).simulate(case.x0, acting)
    std = np.full(len(model.outputs), np.nan)
    for name, value in {"concentrate_grade": 1e-3, **MEASURED}.items():
        std[model.index("outputs", name)] = value
    outputs = truth.outputs + std * generator.standard_normal(truth.outputs.shape)
    samples = tuple(Sample(float(t), u, y) for t, u, y in zip(truth.time, known, outputs, strict=True))
    return replay(rpem_full(case.setup, **options), case.prior, samples), truth.states


def test_level_and_tails_flow_follow_where_the_feed_flow_is_not_what_is_known(cell_case: CellCase) -> None:
    """A feed flow of 20 % more than measured: without correction the estimated level and tails flow are off by it."""
    errors = []
    for options in ({}, {"correct_state": MEASURED}):
        tracked, truth = cell_run(cell_case, 0.2, **options)
        errors.append(np.sqrt(np.mean((np.array([e.state for e in tracked]) - truth)[60:] ** 2, axis=0)))
    model = cell_case.setup.model
    for state in ("level", "tails_flow"):
        j = model.index("states", state)
        assert errors[1][j] < errors[0][j] / 3, state


def test_where_the_inputs_are_right_the_correction_adds_less_than_the_noise_of_the_instruments(
    cell_case: CellCase,
) -> None:
    tracked, truth = cell_run(cell_case, 0.0, correct_state=MEASURED)
    error = np.sqrt(np.mean((np.array([e.state for e in tracked]) - truth) ** 2, axis=0))
    for state, noise in MEASURED.items():
        assert error[cell_case.setup.model.index("states", state)] < noise / 2


@pytest.mark.parametrize("value", [1e3, -1e3, 1e300])
def test_an_absurd_level_moves_the_state_a_little_and_never_out_of_its_range(cell_case: CellCase, value: float) -> None:
    """Also when the instrument stays absurd: the state keeps within the physical range, and the run goes on."""
    setup, level = cell_case.setup, cell_case.setup.model.index("outputs", "level")
    estimator = rpem_full(setup, correct_state=MEASURED)
    wild = []
    for sample in cell_case.samples:
        outputs = sample.outputs.copy()
        outputs[level] = value
        wild.append(replace(sample, outputs=outputs))
    plain = replay(estimator, cell_case.prior, cell_case.samples)
    once = replay(estimator, cell_case.prior, (wild[0], *cell_case.samples[1:]))
    at = setup.model.index("states", "level")
    assert abs(once[0].state[at] - plain[0].state[at]) < 10e-3
    assert abs(once[-1].state[at] - plain[-1].state[at]) < 1e-3
    lower, upper = (np.array([getattr(s, b) for s in setup.model.states]) for b in ("lower", "upper"))
    for e in replay(estimator, cell_case.prior, tuple(wild)):
        assert e.status is not Status.NOT_FINITE and np.isfinite(e.prediction).all()
        assert (lower <= e.state).all() and (e.state <= upper).all()


def test_without_the_measurement_the_state_is_predicted_only(cell_case: CellCase) -> None:
    """A missing level and tails flow: the estimates of an estimator that does not correct."""
    blind = []
    for sample in cell_case.samples:
        outputs = np.full_like(sample.outputs, np.nan)
        outputs[0] = sample.outputs[0]
        blind.append(replace(sample, outputs=outputs))
    tracked = replay(rpem_full(cell_case.setup, correct_state=MEASURED), cell_case.prior, tuple(blind))
    for a, b in zip(tracked, replay(rpem_full(cell_case.setup), cell_case.prior, tuple(blind)), strict=True):
        np.testing.assert_allclose(a.state, b.state, rtol=1e-12)
        np.testing.assert_allclose(a.parameters, b.parameters, rtol=1e-9)
        assert a.status is b.status


def test_a_delayed_level_is_as_good_as_one_in_time(cell_case: CellCase) -> None:
    setup = cell_case.setup
    level = setup.model.index("outputs", "level")
    estimator = DelayedMeasurements(Rpem(setup, correct_state=MEASURED), 20.0)
    state, tracked = estimator.init(cell_case.prior), []
    value = DelayedValue("level", cell_case.samples[10].time, float(cell_case.samples[10].outputs[level]))
    for k, sample in enumerate(cell_case.samples):
        outputs = sample.outputs.copy()
        outputs[level] = np.nan if k == 10 else outputs[level]
        delayed = (value,) if k == 25 else ()
        state, estimate = estimator.update(state, replace(sample, outputs=outputs, delayed=delayed))
        tracked.append(estimate)
    expected = replay(Rpem(setup, correct_state=MEASURED), cell_case.prior, cell_case.samples)
    assert tracked[25].status is Status.DELAYED
    assert not np.array_equal(tracked[20].state, expected[20].state)
    np.testing.assert_array_equal(tracked[-1].state, expected[-1].state)
