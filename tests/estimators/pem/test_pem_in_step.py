"""Records that are searched in step are fitted as each of them alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from adaptive_flot.contracts import Setup, Status
from adaptive_flot.contracts.batch import BatchFit
from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.compiling import compiled
from adaptive_flot.greybox.stepping.compiling.compiled import compiler_problem
from estimators.pem import Pem
from estimators.pem.free_runs import InitialState
from estimators.pem.trust_region import Mask, Squares, solve_in_step
from tests.estimators import toys
from tests.estimators.conftest import CellCase
from tests.estimators.pem.test_pem_nonlinear import INPUT

PROBLEM = compiler_problem()
needs_compiler = pytest.mark.skipif(PROBLEM is not None, reason=f"nothing can be compiled here: {PROBLEM}")


@pytest.fixture(autouse=True)
def own_cache(libraries: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(compiled, "cache_folder", lambda: libraries)
    yield
    compiled._compiler.cache_clear()


def noisy(seed: int, *, steady: bool = False) -> Dataset:
    """A record of a decay with parameters, noise, gaps and a start of its own."""
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0.2, 0.9), rng.uniform(0.5, 2.0)
    inputs = INPUT + (2.0 if steady else 0.0)
    x0 = b * inputs[0] / a if steady else rng.normal()
    record = toys.record(toys.decay(), inputs, parameters={"a": a, "b": b}, x0=(x0,), given=not steady)
    outputs = record.outputs + rng.uniform(0.01, 0.1) * rng.normal(size=record.outputs.shape)
    outputs[rng.random(len(outputs)) < 0.1] = np.nan
    return toys.measured_as(record, outputs)


def pem(model: Model, names: Sequence[str], outputs: Sequence[str], initial_state: InitialState) -> Pem:
    return Pem(Setup(replace(model, compiled=True), 1.0, tuple(names), tuple(outputs)), initial_state=initial_state)


def assert_same_fit(found: BatchFit | Exception, alone: BatchFit) -> None:
    """A search ends where the cost no longer falls, known to the rounding of the cost: 1e-8 of an unknown or so."""
    assert isinstance(found, BatchFit)
    assert found.status is alone.status
    for name in ("covariance", "noise_std", "parameters", "initial_state", "last_state", "joint_covariance"):
        np.testing.assert_allclose(getattr(found, name), getattr(alone, name), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(found.noise_std, alone.noise_std, rtol=1e-9)
    assert found.identifiability.verdict == alone.identifiability.verdict


@needs_compiler
@pytest.mark.parametrize("initial_state", ["given", "estimated", "steady"])
def test_each_record_is_fitted_as_alone(initial_state: InitialState) -> None:
    """And to the bit whatever records are beside it."""
    records = [noisy(seed, steady=initial_state == "steady") for seed in range(11)]
    estimator = pem(toys.decay(), ("a", "b"), ("y",), initial_state)
    fits = estimator.fit_many(records)
    for record, fit in zip(records, fits, strict=True):
        assert_same_fit(fit, estimator.fit(record))
    for chosen in ([4], [9, 2, 7]):
        for k, again in zip(chosen, estimator.fit_many([records[k] for k in chosen]), strict=True):
            assert isinstance(again, BatchFit)
            for name in ("covariance", "noise_std", "parameters", "initial_state", "last_state", "joint_covariance"):
                np.testing.assert_array_equal(getattr(again, name), getattr(fits[k], name))


@needs_compiler
@pytest.mark.slow
def test_records_of_the_cell(model: Model, cell_case: CellCase) -> None:
    """Two outputs, three parameters, a steady start that moves with them."""
    names = ("growth_exponent", "coalescence_rate", "floatability.chalcopyrite")
    estimator = pem(model, names, ("concentrate_grade", "level"), "steady")
    time, noise = np.arange(len(cell_case.inputs), dtype=float), np.array([1e-3, 2e-3])
    columns = model.indices("outputs", ("concentrate_grade", "level"))
    records = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        outputs = np.full((len(time), len(model.outputs)), np.nan)
        p = model.with_parameters({n: model.parameter_values[model.index("parameters", n)] * 1.03 for n in names[:2]})
        empty = Dataset("cell", time, 1.0, cell_case.inputs, outputs)
        free = Pem(Setup(p, 1.0, names, ("level",)))._runs
        problem = free.problem(empty)
        run = free.simulator.outputs(empty, problem.steady, p.parameter_values)[:, columns]
        outputs[:, columns] = run + noise * rng.normal(size=run.shape)
        records.append(replace(empty, outputs=outputs))
    for record, fit in zip(records, estimator.fit_many(records), strict=True):
        assert_same_fit(fit, estimator.fit(record))


@needs_compiler
def test_one_that_meets_a_bound_or_fails_is_the_same_as_alone() -> None:
    """The third record wants a negative b; the fourth has too few measurements."""
    records = [noisy(seed) for seed in range(4)]
    records[2] = toys.measured_as(records[2], -records[2].outputs)
    records[3] = toys.measured_as(records[3], np.where(np.arange(len(INPUT)) < 2, records[3].outputs[:, 0], np.nan))
    estimator = pem(toys.decay(), ("a", "b"), ("y",), "given")
    fits = estimator.fit_many(records)
    for record, fit in zip(records[:3], fits[:3], strict=True):
        assert_same_fit(fit, estimator.fit(record))
    assert isinstance(fits[2], BatchFit) and fits[2].status is Status.PROJECTED
    assert isinstance(fits[3], Exception) and "2 measurements" in str(fits[3])


@needs_compiler
def test_one_without_a_steady_state_does_not_stop_the_others() -> None:
    usual = toys.record(toys.square(), np.full(20, 1.0), x0=(np.sqrt(2.0),), noise=0.01 * np.ones((20, 1)), given=False)
    none = replace(usual, inputs=np.full((20, 1), -3.0))
    estimator = pem(toys.square(), ("p",), ("y",), "steady")
    fits = estimator.fit_many([usual, none, usual])
    assert isinstance(fits[1], RangeError)
    assert_same_fit(fits[0], estimator.fit(usual))


def sums(residuals: FloatArray, jacobian: FloatArray) -> Squares:
    """Sums of squares of residuals (M, N) and derivatives (M, N, d)."""
    turned = jacobian.transpose(0, 2, 1)
    return Squares(0.5 * (residuals**2).sum(axis=1), (turned @ residuals[..., None])[..., 0], turned @ jacobian)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_problems_end_where_scipy_ends(seed: int) -> None:
    """Sums of two exponentials, each problem its own, beside one that is not asked for."""
    rng = np.random.default_rng(seed)
    t, truth = np.linspace(0.0, 4.0, 40), rng.uniform(0.3, 2.0, (4, 2))
    measured = np.exp(-truth[:, :1] * t) + truth[:, 1:] * t + 0.02 * rng.normal(size=(4, 40))
    lower, upper = np.full((4, 2), -10.0), np.full((4, 2), 10.0)
    start = np.ones((4, 2))

    def residuals(x: FloatArray) -> FloatArray:
        return np.exp(-x[:, :1] * t) + x[:, 1:] * t - measured

    def jacobian(x: FloatArray) -> FloatArray:
        return np.stack([-t * np.exp(-x[:, :1] * t), np.broadcast_to(t, (len(x), len(t)))], axis=2)

    asked = np.array([True, True, False, True])

    def evaluate(x: FloatArray, wanted: Mask) -> Squares:
        assert not wanted[2]
        return sums(residuals(x), jacobian(x))

    found = solve_in_step(evaluate, start, lower, upper, asked, 100)
    assert not found.given_up.any()
    np.testing.assert_array_equal(found.converged, asked)
    np.testing.assert_array_equal(found.unknowns[2], start[2])
    for m in np.flatnonzero(asked).tolist():

        def errors(x: FloatArray, m: int = m) -> FloatArray:
            return np.asarray(residuals(np.tile(x, (4, 1)))[m])

        def slopes(x: FloatArray, m: int = m) -> FloatArray:
            return np.asarray(jacobian(np.tile(x, (4, 1)))[m])

        alone = least_squares(errors, start[m], slopes, bounds=(lower[m], upper[m]), xtol=1e-10, ftol=1e-10)
        np.testing.assert_allclose(found.unknowns[m], alone.x, rtol=1e-6)
        assert 0.5 * (residuals(found.unknowns)[m] ** 2).sum() == pytest.approx(alone.cost, rel=1e-9)


def test_a_search_that_runs_out_of_evaluations_has_not_converged() -> None:
    def evaluate(x: FloatArray, wanted: Mask) -> Squares:
        del wanted
        return sums(np.exp(x) - 30.0, np.exp(x)[..., None])

    found = solve_in_step(evaluate, np.zeros((1, 1)), np.full((1, 1), -9.0), np.full((1, 1), 9.0), np.array([True]), 3)
    assert found.evaluations.tolist() == [3] and not found.converged.any() and not found.given_up.any()
