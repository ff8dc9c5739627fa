"""The batch fit of dynamic models: known parameters are found again, with the spread that the covariance says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import estimators.pem.free_runs
from adaptive_flot.contracts import Setup, Status, full_parameters
from adaptive_flot.contracts.batch import BatchFit
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.record import RecordSimulator
from estimators.pem import Pem
from estimators.pem.free_runs import InitialState
from tests.estimators import toys
from tests.estimators.conftest import NOISE_STD, ROWS, CellCase

INPUT = np.repeat(np.random.default_rng(0).normal(size=15), 4)


def fit_decay(record: Dataset, initial_state: InitialState) -> BatchFit:
    return Pem(Setup(toys.decay(), 1.0, ("a", "b"), ("y",)), initial_state=initial_state).fit(record)


@pytest.mark.parametrize("initial_state", ["given", "estimated"])
@pytest.mark.parametrize(("a", "b"), [(0.8, 2.0), (0.15, 0.4)])
def test_noise_free_record_gives_back_parameters_and_initial_state(
    a: float, b: float, initial_state: InitialState
) -> None:
    record = toys.record(toys.decay(), INPUT, parameters={"a": a, "b": b}, x0=(0.7,))
    result = fit_decay(record, initial_state)
    # the initial state has a prior, as wide as its scale, that a record without noise does not feel
    np.testing.assert_allclose(result.values(), [a, b], rtol=1e-6)
    np.testing.assert_allclose(result.initial_state, [0.7], rtol=1e-6)
    np.testing.assert_allclose(result.last_state, record.outputs[-1], rtol=1e-6)


def test_steady_start_moves_with_the_parameters() -> None:
    """The record starts at b u / a, which is not the steady state of the first guess."""
    inputs = INPUT + 2.0
    record = toys.record(
        toys.decay(), inputs, parameters={"a": 0.8, "b": 2.0}, x0=(2.0 * inputs[0] / 0.8,), given=False
    )
    result = fit_decay(record, "steady")
    np.testing.assert_allclose(result.values(), [0.8, 2.0], rtol=1e-6)
    np.testing.assert_allclose(result.initial_state, [2.0 * inputs[0] / 0.8], rtol=1e-6)


def test_spread_of_many_fits_is_the_covariance() -> None:
    """Monte Carlo of 150 noisy records: mean squared normalised error 1, correlation and coverage as announced."""
    truth, noise = np.array([0.5, 1.2]), 0.1
    clean = toys.record(toys.decay(), INPUT, parameters={"a": 0.5, "b": 1.2})
    generator = np.random.default_rng(1)
    estimator = Pem(Setup(toys.decay(), 1.0, ("a", "b"), ("y",)), initial_state="given")
    fits = [
        estimator.fit(toys.measured_as(clean, clean.outputs + noise * generator.normal(size=clean.outputs.shape)))
        for _ in range(150)
    ]
    error = np.array([f.values() for f in fits]) - truth
    distance = np.array([e @ np.linalg.solve(f.covariance, e) for e, f in zip(error, fits, strict=True)])
    assert np.mean(distance) == pytest.approx(2.0, rel=0.25)  # chi-squared with 2 degrees of freedom
    announced = np.mean([f.covariance for f in fits], axis=0)
    assert np.sqrt(np.diag(np.cov(error.T)) / np.diag(announced)) == pytest.approx([1.0, 1.0], rel=0.15)
    correlation = announced[0, 1] / np.sqrt(announced[0, 0] * announced[1, 1])
    assert np.corrcoef(error.T)[0, 1] == pytest.approx(correlation, abs=0.12)
    covered = np.abs(error) < 2 * np.array([[e.std for e in f.estimates] for f in fits])
    assert 0.90 < covered.mean() < 0.99
    assert np.mean([f.noise_std[0] for f in fits]) == pytest.approx(noise, rel=0.02)


@dataclass(frozen=True)
class CellRecord:
    """A noisy minute of the cell at other parameters than its nominal ones, from their steady state."""

    setup: Setup
    truth: FloatArray
    record: Dataset


@pytest.fixture(scope="module")
def cell_record(cell_case: CellCase, model: Model) -> CellRecord:
    names = ("growth_exponent", "coalescence_rate", "floatability.chalcopyrite")
    setup = Setup(model, 1.0, names, ("concentrate_grade", "level"))
    truth = model.parameter_values[model.indices("parameters", names)] * [1.04, 0.95, 1.03]
    p = full_parameters(model, names, truth)
    x0 = steady_state(model, cell_case.inputs[0], p).state
    time = np.arange(ROWS, dtype=float)
    empty = Dataset("cell", time, 1.0, cell_case.inputs, np.full((ROWS, len(model.outputs)), np.nan))
    outputs = RecordSimulator(model, 1.0).outputs(empty, x0, p)
    outputs += NOISE_STD * np.random.default_rng(2).normal(size=outputs.shape)
    return CellRecord(setup, truth, toys.measured_as(empty, outputs))


@pytest.mark.parametrize("initial_state", ["steady", "estimated"])
def test_cell_parameters_are_found_within_four_standard_deviations(
    cell_record: CellRecord, initial_state: InitialState
) -> None:
    result = Pem(cell_record.setup, initial_state=initial_state).fit(cell_record.record)
    assert result.status is Status.OK
    assert np.all(np.abs(result.values() - cell_record.truth) < 4 * np.sqrt(np.diag(result.covariance)))
    np.testing.assert_allclose(result.noise_std, NOISE_STD, rtol=0.25)


@pytest.mark.parametrize("initial_state", ["steady", "estimated"])
def test_cell_fit_is_as_likely_as_the_truth(cell_record: CellRecord, initial_state: InitialState) -> None:
    """Twice the log-likelihood ratio is chi-squared (3 or 12 unknowns), whatever the shape of the n-C valley."""
    setup, record = cell_record.setup, cell_record.record
    result = Pem(setup, initial_state=initial_state).fit(record)
    columns = setup.model.indices("outputs", setup.outputs)

    def squares(x0: FloatArray, p: FloatArray) -> float:
        error = (record.outputs - RecordSimulator(setup.model, 1.0).outputs(record, x0, p))[:, columns]
        return float(np.sum((error / NOISE_STD) ** 2))

    p = full_parameters(setup.model, setup.parameters, cell_record.truth)
    at_truth = squares(steady_state(setup.model, record.inputs[0], p).state, p)
    assert 0.0 < at_truth - squares(result.initial_state, result.parameters) < 30.0


@pytest.mark.parametrize("initial_state", ["steady", "estimated"])
def test_jacobian_of_the_whole_problem_is_the_derivative_of_its_residuals(
    cell_record: CellRecord, initial_state: InitialState, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Taken where SciPy gets it; central differences away from the start, so that every term is at work."""
    handed: list[tuple[Callable[[FloatArray], FloatArray], FloatArray, Callable[[FloatArray], FloatArray]]] = []

    def spy(residuals: Any, start: FloatArray, jacobian: Any, **_: Any) -> None:
        handed.append((residuals, start, jacobian))
        raise InterruptedError

    monkeypatch.setattr(estimators.pem.free_runs, "least_squares", spy)
    with pytest.raises(InterruptedError):
        Pem(cell_record.setup, initial_state=initial_state).fit(cell_record.record)
    residuals, start, jacobian = handed[0]
    at = start + 0.01 * np.random.default_rng(3).uniform(-1, 1, size=start.size)
    step = 1e-5
    differences = np.column_stack(
        [(residuals(at + d) - residuals(at - d)) / (2 * step) for d in step * np.eye(start.size)]
    )
    given = jacobian(at)
    assert given.shape == differences.shape
    size = np.abs(differences).max(axis=0)
    assert np.all(size > 0)
    np.testing.assert_allclose(given / size, differences / size, atol=2e-6)
