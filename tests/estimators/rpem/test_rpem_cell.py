"""RPEM of the flotation cell against the plain SciPy reference, and what happens at its edges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.contracts import AnyEstimator, Prior, Sample, Setup, Status
from adaptive_flot.greybox.model import Model, Parameter
from benchmarks.timing import scipy_reference
from estimators.fixed import Fixed
from estimators.rpem.estimator import Rpem
from tests.estimators import toys
from tests.estimators.conftest import NOISE_STD, CellCase, replay


@pytest.mark.parametrize("gradient", ["exact", "central"])
def test_estimates_are_those_of_the_scipy_reference(cell_case: CellCase, gradient: str) -> None:
    """Same x0, theta0 and L0; the reference integrates with LSODA and a root find and takes central differences."""
    case = cell_case
    grade = np.array([s.outputs[0] for s in case.samples])
    reference = scipy_reference.rpem(
        case.x0, case.prior.parameters, case.prior.covariance / NOISE_STD**2, case.inputs, grade, forgetting=0.98
    )
    tracked = replay(Rpem(case.setup, forgetting=0.98, gradient=gradient), case.prior, case.samples)  # type: ignore[arg-type]
    np.testing.assert_allclose([e.parameters for e in tracked], reference.theta, rtol=1e-4)
    np.testing.assert_allclose([e.prediction[0] for e in tracked], reference.grade, rtol=1e-4)
    np.testing.assert_allclose([e.state for e in tracked], reference.states, rtol=1e-4)
    np.testing.assert_allclose(tracked[-1].covariance, NOISE_STD**2 * reference.inverse_hessian, rtol=1e-3)
    # the record moves the estimates by more than the tolerance
    assert np.all(np.abs(tracked[-1].parameters / case.prior.parameters - 1) > 1e-3)


def test_central_differences_and_exact_gradient_agree(cell_case: CellCase) -> None:
    exact, central = (
        replay(Rpem(cell_case.setup, gradient=g), cell_case.prior, cell_case.samples) for g in ("exact", "central")
    )
    for a, b in zip(exact, central, strict=True):
        np.testing.assert_allclose(a.parameters, b.parameters, rtol=1e-5)
        std = np.sqrt(np.diag(a.covariance))
        np.testing.assert_allclose(a.covariance / np.outer(std, std), b.covariance / np.outer(std, std), atol=1e-5)


def test_without_prior_uncertainty_it_is_the_fixed_estimator(cell_case: CellCase) -> None:
    sure = replace(cell_case.prior, covariance=1e-24 * cell_case.prior.covariance)
    adaptive, fixed = (replay(e(cell_case.setup), sure, cell_case.samples) for e in (Rpem, Fixed))
    for a, f in zip(adaptive, fixed, strict=True):
        np.testing.assert_allclose(a.parameters, f.parameters, rtol=1e-12)
        np.testing.assert_allclose(a.prediction, f.prediction, rtol=1e-9)
        np.testing.assert_allclose(a.innovation, f.innovation, atol=1e-9)
        np.testing.assert_allclose(a.innovation_std, NOISE_STD, rtol=1e-9)


def test_prediction_is_the_step_from_the_last_state_with_the_last_estimate(cell_case: CellCase) -> None:
    """What (thetaupdate) means by the one-step prediction, re-done with the fixed estimator sample by sample."""
    tracked = replay(Rpem(cell_case.setup), cell_case.prior, cell_case.samples)
    fixed = Fixed(cell_case.setup)
    for before, now, sample in zip(tracked, tracked[1:], cell_case.samples[1:], strict=False):
        start = Prior(before.time, before.state, before.parameters, before.covariance, cell_case.prior.noise_std)
        _, expected = fixed.update(fixed.init(start), sample)
        np.testing.assert_allclose(now.prediction, expected.prediction, rtol=1e-11)
        np.testing.assert_allclose(now.state, expected.state, rtol=1e-11)


def test_missing_grade_leaves_theta_and_covariance_alone_though_the_level_is_there(cell_case: CellCase) -> None:
    """The level is measured but does not drive the adaptation; the state is predicted on."""
    estimator = Rpem(cell_case.setup, forgetting=0.9)
    state, before = estimator.update(estimator.init(cell_case.prior), cell_case.samples[0])
    outputs = cell_case.samples[1].outputs.copy()
    outputs[0] = np.nan
    assert np.isfinite(outputs).any()
    _, after = estimator.update(state, replace(cell_case.samples[1], outputs=outputs))
    assert after.status is Status.MISSING
    np.testing.assert_array_equal(after.parameters, before.parameters)
    np.testing.assert_array_equal(after.covariance, before.covariance)
    assert not np.array_equal(after.state, before.state)


def _bounded(model: Model, names: tuple[str, ...], share: float) -> Model:
    def narrow(p: Parameter) -> Parameter:
        return replace(p, lower=p.value * (1 - share), upper=p.value * (1 + share)) if p.name in names else p

    return replace(model, parameters=tuple(narrow(p) for p in model.parameters))


def test_estimates_are_projected_onto_their_bounds_and_say_so(cell_case: CellCase) -> None:
    """The status is PROJECTED exactly where an estimate lies on a bound, and the estimate never leaves them."""
    setup = replace(cell_case.setup, model=_bounded(cell_case.setup.model, cell_case.setup.parameters, 0.004))
    low, high = 0.996 * cell_case.prior.parameters, 1.004 * cell_case.prior.parameters
    tracked = replay(Rpem(setup), cell_case.prior, cell_case.samples)
    on_bound = [bool((e.parameters == low).any() or (e.parameters == high).any()) for e in tracked]
    assert [e.status is Status.PROJECTED for e in tracked] == on_bound
    assert 5 < sum(on_bound) < len(tracked), "the case must have both kinds of sample"
    assert all((low <= e.parameters).all() and (e.parameters <= high).all() for e in tracked)


@pytest.mark.parametrize("estimator", [Rpem, Fixed])
def test_a_step_that_is_not_finite_is_skipped_and_the_next_goes_on(
    cell_case: CellCase, estimator: Callable[[Setup], AnyEstimator]
) -> None:
    made = estimator(cell_case.setup)
    state, before = made.update(made.init(cell_case.prior), cell_case.samples[0])
    state, broken = made.update(state, replace(cell_case.samples[1], inputs=np.full(3, np.nan)))
    assert broken.status is Status.NOT_FINITE
    np.testing.assert_array_equal(broken.parameters, before.parameters)
    np.testing.assert_array_equal(broken.covariance, before.covariance)
    np.testing.assert_array_equal(broken.state, before.state)
    _, following = made.update(state, cell_case.samples[2])
    assert following.status is Status.OK
    assert np.isfinite(following.prediction).all() and np.isfinite(following.parameters).all()


@pytest.mark.parametrize("estimator", [Rpem, Fixed])
def test_a_prediction_that_is_not_finite_is_not_ok(estimator: Callable[[Setup], AnyEstimator]) -> None:
    """The state of this model is finite, its output is not: the status of the sample must say so."""
    made = estimator(Setup(toys.root(), 1.0, ("th",), ("y",)))
    state = made.init(Prior(0.0, np.zeros(1), np.ones(1), np.eye(1), np.ones(1)))
    state, broken = made.update(state, Sample(1.0, np.array([-1.0]), np.array([1.0])))
    assert broken.status is Status.NOT_FINITE
    assert broken.parameters[0] == 1.0 and np.isfinite(broken.covariance).all()
    _, following = made.update(state, Sample(2.0, np.array([4.0]), np.array([2.0])))
    assert following.status is Status.OK and following.prediction[0] == pytest.approx(2.0)


def test_covariance_of_one_parameter_is_one_by_one() -> None:
    """The contract: (q, q), also for q = 1, in the estimate and as the prior of another estimator."""
    made = Rpem(Setup(toys.root(), 1.0, ("th",), ("y",)))
    state = made.init(Prior(0.0, np.zeros(1), np.ones(1), np.eye(1), np.ones(1)))
    _, estimate = made.update(state, Sample(1.0, np.array([1.0]), np.array([1.0])))
    assert estimate.covariance.shape == (1, 1)


def test_a_longer_memory_gives_a_smaller_covariance(cell_case: CellCase) -> None:
    wide = replace(cell_case.prior, covariance=100 * cell_case.prior.covariance)
    spread = [
        np.trace(replay(Rpem(cell_case.setup, forgetting=f), wide, cell_case.samples)[-1].covariance)
        for f in (0.9, 0.97, 1.0)
    ]
    assert spread[0] > spread[1] > spread[2]
