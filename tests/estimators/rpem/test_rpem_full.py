"""The full recursion: propagated state sensitivities, and forgetting that stays bounded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup, full_parameters
from adaptive_flot.greybox.model import FloatArray, Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.processes.cascaded_tanks import read_benchmark
from adaptive_flot.processes.registry import make_model
from benchmarks.estimation.forgetting import Recursion, stabilised
from estimators.rpem.estimator import Rpem
from estimators.rpem.full import rpem_full
from estimators.rpem.state import RpemState
from estimators.rpem.update import alternative_covariance
from tests.estimators import toys
from tests.estimators.conftest import CellCase, replay

ROWS = 80


def filtered() -> Model:
    """dx/dt = -0.3 x + b u, y = x + d v: linear in b and d, and b acts through the state alone."""

    def equations(s: Scope) -> None:
        s.derivative("x", -0.3 * s.state("x") + s.parameter("b") * s.input("u"))
        s.output("y", s.state("x") + s.parameter("d") * s.input("v"))

    return Model(
        name="filtered",
        states=(Quantity("x", "-", ""),),
        inputs=(Quantity("u", "-", ""), Quantity("v", "-", "")),
        parameters=tuple(Parameter(n, 1.0, "-", "", None, -50.0, 50.0, 1.0) for n in ("b", "d")),
        outputs=(Quantity("y", "-", ""),),
        equations=equations,
    )


def run(model: Model, inputs: FloatArray, measured: FloatArray, prior: Prior, **options: Any) -> list[Estimate]:
    setup = Setup(model, 1.0, model.names("parameters"), model.names("outputs"))
    samples = tuple(Sample(k + 1.0, u, y) for k, (u, y) in enumerate(zip(inputs, measured, strict=True)))
    return replay(Rpem(setup, gradient="recursive", **options), prior, samples)


def regression_case() -> tuple[Model, FloatArray, FloatArray, FloatArray, Prior]:
    """Model, inputs, regressors (N, 2) from free runs of the model, measurements and prior."""
    generator = np.random.default_rng(3)
    model, inputs = filtered(), generator.normal(size=(ROWS, 2))
    stepper, x0 = Stepper(model, 1.0), np.array([0.7])
    free = [stepper.simulate(x0, inputs, np.array(p)).outputs[:, 0] for p in ([0.0, 0.0], [1.0, 0.0], [0.0, 1.0])]
    regressors = np.column_stack([free[1] - free[0], free[2] - free[0]])
    measured = free[0] + regressors @ np.array([2.0, -0.5]) + 0.3 * generator.normal(size=ROWS)
    prior = Prior(0.0, x0, np.array([0.5, 0.5]), np.array([[2.0, 0.3], [0.3, 1.0]]), np.array([0.3]))
    return model, inputs, regressors, measured - free[0], prior


@pytest.mark.parametrize("share", [None, 0.8])
@pytest.mark.parametrize("forgetting", [1.0, 0.97, 0.9])
def test_it_is_recursive_least_squares_where_the_free_run_is_linear_in_the_parameters(
    forgetting: float, share: float | None
) -> None:
    """Estimates, covariances and the state are those of the information recursion on the free run's regressors.

    R <- lambda R + (1 - lambda) A^-1 + psi psi' / sigma^2; b acts through the state only, which the one-step gradient
    does not see.
    """
    model, inputs, regressors, measured, prior = regression_case()
    zero = Stepper(model, 1.0).simulate(prior.state, inputs, np.zeros(2)).outputs[:, 0]
    tracked = run(model, inputs, (measured + zero)[:, None], prior, forgetting=forgetting, forget_to=share)
    towards = np.zeros((2, 2)) if share is None else np.eye(2) / share**2
    theta, R, sigma = prior.parameters, np.linalg.inv(prior.covariance), prior.noise_std[0]
    for k, (psi, y) in enumerate(zip(regressors, measured, strict=True)):
        R = forgetting * R + (1 - forgetting) * towards + np.outer(psi, psi) / sigma**2
        theta = theta + np.linalg.solve(R, psi) * (y - psi @ theta) / sigma**2
        np.testing.assert_allclose(tracked[k].parameters, theta, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(tracked[k].covariance, np.linalg.inv(R), rtol=1e-9, atol=1e-9)
    end = Stepper(model, 1.0).simulate(prior.state, inputs, tracked[-1].parameters).states[-1]
    np.testing.assert_allclose(tracked[-1].state, end, rtol=1e-9)
    assert np.abs(tracked[-1].parameters - [2.0, -0.5]).max() < 0.3, "the record tells b and d"


def test_the_one_step_gradient_is_another_estimator_there() -> None:
    """Guards the test above: it must not hold of any recursion."""
    model, inputs, _, measured, prior = regression_case()
    zero = Stepper(model, 1.0).simulate(prior.state, inputs, np.zeros(2)).outputs[:, 0]
    outputs = (measured + zero)[:, None]
    setup = Setup(model, 1.0, model.names("parameters"), model.names("outputs"))
    samples = tuple(Sample(k + 1.0, u, y) for k, (u, y) in enumerate(zip(inputs, outputs, strict=True)))
    one_step = replay(Rpem(setup, forgetting=1.0), prior, samples)[-1].parameters
    full = run(model, inputs, outputs, prior, forgetting=1.0)[-1].parameters
    assert np.abs(one_step - full).max() > 0.01, "apart by far more than the tolerance above"


@pytest.mark.parametrize("forgetting", [1.0, 0.9])
@pytest.mark.parametrize(("q", "m"), [(1, 1), (3, 2)])
def test_without_a_state_the_gradients_agree(q: int, m: int, forgetting: float) -> None:
    """Where the output is an instantaneous linear regression both gradients give the same estimates."""
    generator = np.random.default_rng(q + m)
    model, inputs, measured = toys.linear(q, m), generator.normal(size=(40, m * q)), generator.normal(size=(40, m))
    prior = Prior(0.0, np.zeros(1), np.zeros(q), np.eye(q), np.ones(m))
    tracked = run(model, inputs, measured, prior, forgetting=forgetting)
    setup = Setup(model, 1.0, model.names("parameters"), model.names("outputs"))
    samples = tuple(Sample(k + 1.0, u, y) for k, (u, y) in enumerate(zip(inputs, measured, strict=True)))
    for a, b in zip(tracked, replay(Rpem(setup, forgetting=forgetting), prior, samples), strict=True):
        np.testing.assert_allclose(a.parameters, b.parameters, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-9, atol=1e-12)


def test_the_sensitivity_is_that_of_a_free_run_with_constant_parameters(cell_case: CellCase) -> None:
    """dx/dtheta after a minute of the cell against central differences of whole free runs."""
    case = cell_case
    sure = replace(case.prior, covariance=1e-24 * case.prior.covariance)
    estimator = Rpem(case.setup, gradient="recursive")
    state: RpemState = estimator.init(sure)
    for sample in case.samples:
        state, _ = estimator.update(state, sample)
    stepper = Stepper(case.setup.model, case.setup.dt)

    def end(theta: FloatArray) -> FloatArray:
        p = full_parameters(case.setup.model, case.setup.parameters, theta)
        last: FloatArray = stepper.simulate(case.x0, case.inputs, p).states[-1]
        return last

    moves = np.diag(1e-4 * sure.parameters)
    differences = np.column_stack(
        [(end(sure.parameters + d) - end(sure.parameters - d)) / (2 * d.sum()) for d in moves]
    )
    size = np.abs(differences).max(axis=1, keepdims=True) + 1e-12
    np.testing.assert_allclose(state.sensitivity / size, differences / size, atol=1e-5)


def test_gradient_of_the_prediction_is_that_of_the_free_run() -> None:
    """Psi of a nonlinear free run, read off the first update with a vanishing covariance, by the jump of theta."""
    model = toys.decay()
    setup = Setup(model, 1.0, model.names("parameters"), ("y",))
    generator = np.random.default_rng(4)
    inputs, x0, theta = generator.uniform(0.5, 2.0, size=(12, 1)), np.array([0.4]), np.array([0.4, 1.0])
    stepper, small = Stepper(model, 1.0), 1e-10
    prior = Prior(0.0, x0, theta, small * np.eye(2), np.ones(1))
    estimator = Rpem(setup, gradient="recursive", forgetting=1.0)
    state = estimator.init(prior)
    quiet = [Sample(k + 1.0, u, np.full(1, np.nan)) for k, u in enumerate(inputs)]
    for sample in quiet[:-1]:
        state, _ = estimator.update(state, sample)
    _, blind = estimator.update(state, quiet[-1])
    _, seeing = estimator.update(state, replace(quiet[-1], outputs=blind.prediction + 1.0))
    psi = (seeing.parameters - theta) / small
    moves = 1e-5 * np.eye(2)
    ends = [[stepper.simulate(x0, inputs, theta + s * d).outputs[-1, 0] for s in (1, -1)] for d in moves]
    np.testing.assert_allclose(psi, [(a - b) / 2e-5 for a, b in ends], rtol=1e-5)


def test_the_covariance_stays_below_the_one_that_is_forgotten_to(cell_case: CellCase) -> None:
    """No wind-up: without excitation it ends at A, where exponential forgetting grows without end."""
    still = tuple(Sample(float(k + 1), cell_case.inputs[0], s.outputs) for k, s in enumerate(cell_case.samples * 5))
    bounded = replay(rpem_full(cell_case.setup, forget_to=0.05), cell_case.prior, still)
    A = alternative_covariance(cell_case.setup, 0.05)
    scale = np.sqrt(np.outer(np.diag(A), np.diag(A)))
    assert all(np.linalg.eigvalsh(e.covariance / scale).max() <= 1 + 1e-9 for e in bounded)
    free = replay(rpem_full(cell_case.setup, forget_to=None), cell_case.prior, still)
    assert np.linalg.eigvalsh(free[-1].covariance / scale).max() > 2


def test_a_known_start_of_state_and_parameters_is_used(cell_case: CellCase) -> None:
    """A joint covariance ties the state to the parameters: its sensitivity starts from there."""
    slope = np.outer(np.arange(1.0, 1 + cell_case.x0.size), [1.0, 2.0]) * 1e-3
    P = cell_case.prior.covariance
    joint = np.block([[slope @ P @ slope.T, slope @ P], [P @ slope.T, P]])
    state = Rpem(cell_case.setup, gradient="recursive").init(replace(cell_case.prior, joint_covariance=joint))
    np.testing.assert_allclose(state.sensitivity, slope, rtol=1e-9)


def test_the_compiled_update_is_the_recursion_written_out_in_numpy(cell_case: CellCase) -> None:
    """The study of forgetting (`benchmarks.estimation.forgetting`) measures what `rpem_full` does."""
    prior, samples = cell_case.prior, cell_case.samples
    thetas, predictions = Recursion(cell_case.setup).run(prior, list(samples), stabilised(0.9, 0.05))
    # the study forgets after a sample, the estimator before the next: the first differs by what the prior forgets
    start = replace(prior, covariance=_unforgotten(cell_case, 0.9, 0.05))
    tracked = replay(rpem_full(cell_case.setup, freeze_s=None), start, samples)
    np.testing.assert_allclose([e.parameters for e in tracked], thetas, rtol=1e-7)
    np.testing.assert_allclose([e.prediction[0] for e in tracked], predictions, rtol=1e-7)


def _unforgotten(case: CellCase, factor: float, share: float) -> FloatArray:
    """The covariance that is forgotten to that of the prior."""
    A = alternative_covariance(case.setup, share)
    before = (np.linalg.inv(case.prior.covariance) - (1 - factor) * np.linalg.inv(A)) / factor
    covariance = np.linalg.inv(before).astype(np.float64)
    return (covariance + covariance.T) / 2


def test_on_the_cascaded_tanks_the_full_recursion_predicts_better(shared_file: Callable[[str], Path]) -> None:
    """Measured data: the level remembers for minutes, so the one-step gradient sees a small part of what theta does."""
    model = make_model("cascaded-tanks")
    record, _ = read_benchmark(shared_file("data/cascaded-tanks/dataBenchmark.csv"))
    setup = Setup(model, record.dt, model.names("parameters"), ("level",))
    first = record.outputs[0, 0]
    nominal = model.parameter_values
    prior = Prior(record.time[0], np.array([first, first]), nominal, np.diag((0.3 * nominal) ** 2), np.array([0.1]))
    samples = tuple(
        Sample(float(t), u, y) for t, u, y in zip(record.time[1:], record.inputs[1:], record.outputs[1:], strict=True)
    )
    errors = []
    for estimator in (Rpem(setup), rpem_full(setup)):
        tracked = np.array([e.innovation[0] for e in replay(estimator, prior, samples)])
        errors.append(float(np.sqrt(np.mean(tracked[len(tracked) // 2 :] ** 2))))
    assert errors[1] < 0.7 * errors[0], errors
