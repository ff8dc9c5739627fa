"""Multiple-model filter: its parts against plain NumPy, its limits against single filters, and what it is for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.contracts import Prior, Sample, Setup
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from estimators.ekf import Ekf
from estimators.imm.estimator import Imm
from estimators.imm.mixing import combine_function, mix_function
from estimators.imm.modes import make_modes, stationary, transitions
from estimators.shared.coordinates import Coordinates
from estimators.shared.joint_filter import layout
from tests.estimators import toys
from tests.estimators.gaussian import LinearRecord, linear_record, run_estimator

DURATIONS = {"rest": 30.0, "drift": 20.0, "jump": 2.0}


def random_mixture(seed: int, n: int, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    generator = np.random.default_rng(seed)
    halves = generator.normal(size=(count, n, n))
    return generator.normal(size=(n, count)), halves @ halves.transpose(0, 2, 1), generator.dirichlet(np.ones(count))


@given(seed=st.integers(0, 10**6))
def test_mixing_is_the_conditional_mixture_of_samples(seed: int) -> None:
    """Mean and covariance of z given the mode to come, summed component by component with numpy."""
    setup = linear_record(1).setup
    shape, coordinates = layout(setup, integrated=True), Coordinates.of(setup.model, setup.parameters)
    modes = make_modes(setup, coordinates, shape, 1.0, 2.0, 0.05, 0.0)
    matrix = transitions(modes, DURATIONS, 0.3, 1.0)  # type: ignore[arg-type]
    z, P, probability = random_mixture(seed, shape.size, len(modes))
    mixed, mixed_P, predicted = FastCall(mix_function(shape, modes, matrix))(z, np.hstack(list(P)), probability)
    np.testing.assert_allclose(predicted, matrix.T @ probability, rtol=1e-12)
    for j, mode in enumerate(modes):
        weights = matrix[:, j] * probability / predicted[j]
        starts, spreads = z.copy(), P.copy()
        for i in range(len(modes)):
            if i != j:
                starts[4:, i], spreads[i, 4:, :], spreads[i, :, 4:] = 0.0, 0.0, 0.0
                spreads[i, 4:, 4:] = mode.entry[4:, 4:]
        mean = starts @ weights
        second = sum(w * (S + np.outer(m, m)) for w, S, m in zip(weights, spreads, starts.T, strict=True))
        np.testing.assert_allclose(mixed[:, j], mean, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(mixed_P[:, 6 * j : 6 * j + 6], second - np.outer(mean, mean), atol=1e-9)


def test_combination_of_equal_modes_is_any_of_them() -> None:
    setup = linear_record(1).setup
    shape = layout(setup, integrated=True)
    z, P, probability = random_mixture(3, 6, 5)
    mean, covariance = FastCall(combine_function(shape, 5))(
        np.tile(z[:, :1], (1, 5)), np.hstack([P[0]] * 5), probability
    )
    np.testing.assert_allclose(mean, z[:, 0], rtol=1e-12)
    np.testing.assert_allclose(covariance, P[0], rtol=1e-12)


@pytest.mark.parametrize("q", [1, 2, 3])
def test_transitions_keep_the_mean_durations(q: int) -> None:
    model = toys.linear(q)
    setup = Setup(model, 0.5, model.names("parameters"), model.names("outputs"))
    shape, coordinates = layout(setup, integrated=True), Coordinates.of(model, setup.parameters)
    modes = make_modes(setup, coordinates, shape, 1.0, 2.0, 0.05, 0.0)
    matrix = transitions(modes, DURATIONS, 0.3, setup.dt)  # type: ignore[arg-type]
    assert len(modes) == 2 * q + 1
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0)
    for i, mode in enumerate(modes):
        assert setup.dt / (1 - matrix[i, i]) == pytest.approx(DURATIONS[mode.kind])
    shares = stationary(matrix)
    np.testing.assert_allclose(shares @ matrix, shares, atol=1e-12)


def test_without_changes_it_is_the_filter_of_constant_parameters() -> None:
    """Rest for ever and changes of no size: every mode is the same Kalman filter."""
    record = linear_record(4)
    nothing = {"rate_per_hour": 1e-9, "rate_change_per_hour": 1e-9, "jump": 1e-9, "rest_s": 1e12}
    estimates = run_estimator(Imm(record.setup, **nothing, outlier_std=np.inf), record)
    expected = run_estimator(Ekf(record.setup, drift_per_hour=0.0, outlier_std=np.inf), record)
    for a, b in zip(estimates, expected, strict=True):
        np.testing.assert_allclose(a.parameters, b.parameters, rtol=1e-6)
        np.testing.assert_allclose(a.state, b.state, rtol=1e-6)
        np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-6)
        np.testing.assert_allclose(a.innovation_std, b.innovation_std, rtol=1e-6)
        assert a.status is b.status


@pytest.mark.parametrize("moving", [0, 1])
@pytest.mark.parametrize("step", [True, False])
def test_it_finds_which_parameter_changes_and_leaves_the_other_alone(moving: int, step: bool) -> None:
    """Two regressors that are hard to tell apart; a random walk of both moves both, the modes move the right one."""
    generator = np.random.default_rng(5)
    rows = 400
    inputs = generator.normal(size=(rows, 1)) * np.array([1.0, 1.0]) + 0.1 * generator.normal(size=(rows, 2))
    theta = np.tile([1.0, 1.0], (rows, 1))
    late = np.arange(rows) - 100
    theta[:, moving] += 0.3 * (late >= 0) if step else 0.3 * np.clip(late / 250, 0, 1)
    outputs = (inputs * theta).sum(axis=1) + 0.02 * generator.normal(size=rows)
    model = toys.linear(2, value=1.0)
    setup = Setup(model, 1.0, model.names("parameters"), model.names("outputs"))
    prior = Prior(0.0, np.zeros(1), np.ones(2), 1e-4 * np.eye(2), np.array([0.02]))
    errors = {}
    for name, estimator in (("imm", Imm(setup)), ("ekf", Ekf(setup, drift_per_hour=0.6))):
        samples = tuple(Sample(k + 1.0, inputs[k], outputs[k : k + 1]) for k in range(rows))
        estimates = run_estimator(estimator, LinearRecord(setup, prior, samples))
        errors[name] = np.sqrt(np.mean((np.array([e.parameters for e in estimates]) - theta)[100:] ** 2, axis=0))
    assert errors["imm"][1 - moving] < 0.7 * errors["ekf"][1 - moving]
    assert errors["imm"][moving] < errors["ekf"][moving]


@pytest.mark.parametrize("options", [{"rest_s": 0.0}, {"jump_share": 1.5}, {"state_noise": -1.0}, {"jump": -0.1}])
def test_an_option_out_of_range_is_a_named_error(options: dict[str, float]) -> None:
    with pytest.raises(ModelError, match="imm"):
        Imm(linear_record(1).setup, **options)
