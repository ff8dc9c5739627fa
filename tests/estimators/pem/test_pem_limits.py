"""What the batch fit says where a record can not give what is asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.contracts import Setup, Status
from adaptive_flot.errors import DataError, RangeError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import Model
from estimators.pem import Pem
from tests.estimators import toys
from tests.estimators.conftest import ROWS, CellCase

NOISE = np.random.default_rng(1).normal(size=(40, 1))
INPUT = np.random.default_rng(2).uniform(0.5, 2.0, size=40)


def test_a_pair_that_acts_only_as_a_product_is_reported_and_stays_finite() -> None:
    record = toys.record(toys.product(), INPUT, parameters={"a": 2.0, "b": 3.0}, noise=0.1 * NOISE)
    result = Pem(Setup(toys.product(), 1.0, ("a", "b"), ("y",)), initial_state="given").fit(record)
    a, b = result.values()
    assert a * b == pytest.approx(6.0, rel=0.05)
    assert np.isfinite(result.covariance).all() and np.isfinite(result.noise_std).all()
    assert [word for _, _, word in result.identifiability.parameters] == ["not identified", "not identified"]
    assert [{x, y} for x, y, _ in result.identifiability.pairs] == [{"a", "b"}]
    assert "does not identify a, b" in result.identifiability.verdict
    assert "hard to tell apart" in result.identifiability.verdict


def test_a_parameter_that_does_nothing_is_not_identified() -> None:
    """Its regressor is zero throughout; the other one is as well known as without it."""
    model = toys.linear(2, value=0.5)
    record = toys.record(model, np.column_stack([INPUT, 0 * INPUT]), parameters={"th0": 1.0}, noise=0.01 * NOISE)
    result = Pem(Setup(model, 1.0, ("th0", "th1"), ("y0",)), initial_state="given").fit(record)
    assert [word for _, _, word in result.identifiability.parameters] == ["identified", "not identified"]
    assert result.values()[0] == pytest.approx(1.0, abs=0.02) and np.isfinite(result.covariance).all()


@pytest.mark.parametrize(("bounds", "bound"), [((0.0, 1.0), 1.0), ((3.0, 9.0), 3.0)])
def test_a_parameter_on_its_bound_is_projected_and_named(bounds: tuple[float, float], bound: float) -> None:
    """The record wants 2.0; the other parameter is the best one given the bound."""
    model = toys.decay()
    a, b = model.parameters
    start = float(np.mean(bounds))
    model = replace(model, parameters=(a, replace(b, value=start, lower=bounds[0], upper=bounds[1])))
    record = toys.record(toys.decay(), INPUT, parameters={"a": 0.5, "b": 2.0}, noise=0.01 * NOISE)
    result = Pem(Setup(model, 1.0, ("a", "b"), ("y",)), initial_state="given").fit(record)
    assert result.status is Status.PROJECTED
    assert [e.at_bound for e in result.estimates] == [False, True]
    assert result.estimates[1].value == pytest.approx(bound, abs=1e-5)
    assert result.identifiability.parameters[1][2] == "on a bound"
    assert "b ends on a bound" in result.identifiability.verdict


def test_estimates_never_leave_the_range_not_even_by_rounding_where_the_fit_starts_on_the_bound() -> None:
    """A value outside the range could not be given to the model again."""
    model = toys.decay()
    a, b = model.parameters
    model = replace(model, parameters=(a, replace(b, value=1.0, lower=1.0, upper=9.0)))
    record = toys.record(toys.decay(), INPUT, parameters={"a": 0.5, "b": 0.3})
    result = Pem(Setup(model, 1.0, ("a", "b"), ("y",)), initial_state="given").fit(record)
    model.with_parameters({e.name: e.value for e in result.estimates})


@pytest.mark.parametrize("left", [0, 1, 2])
def test_too_few_measurements_are_a_data_error(left: int) -> None:
    """Two unknowns need more than two measurements; the message names the record and both counts."""
    record = toys.record(toys.decay(), INPUT)
    outputs = np.full_like(record.outputs, np.nan)
    outputs[:left] = record.outputs[:left]
    estimator = Pem(Setup(toys.decay(), 1.0, ("a", "b"), ("y",)), initial_state="given")
    with pytest.raises(DataError, match=f"toy: {left} measurements of y for 2 unknowns"):
        estimator.fit(toys.measured_as(record, outputs))


def test_the_initial_state_must_be_in_the_record_where_it_is_said_to_be_given() -> None:
    record = toys.record(toys.decay(), INPUT, given=False)
    with pytest.raises(DataError, match="toy: the first row"):
        Pem(Setup(toys.decay(), 1.0, ("a", "b"), ("y",)), initial_state="given").fit(record)


def test_a_record_that_the_model_can_not_simulate_is_a_status() -> None:
    """With u = -10 the state of dx/dt = p - x^2 + u runs to minus infinity within a second."""
    inputs = np.full(20, 0.5)
    record = toys.record(toys.square(), inputs, x0=(1.0,))
    record.inputs[5:10] = -10.0
    result = Pem(Setup(toys.square(), 1.0, ("p",), ("y",)), initial_state="given").fit(record)
    assert result.status is Status.NOT_FINITE
    assert np.isnan(result.covariance).all() and result.values()[0] == 1.0
    assert "can not simulate" in result.identifiability.verdict


def test_no_steady_state_to_start_from_is_an_error_that_names_the_inputs() -> None:
    """p + u < 0 in the first row: dx/dt = 0 has no solution there, and the record can be cut before the fit."""
    record = toys.record(toys.square(), np.full(20, 0.5), x0=(1.0,), given=False)
    record.inputs[0] = -3.0
    with pytest.raises(RangeError, match=r"no steady state .* at u = -3"):
        Pem(Setup(toys.square(), 1.0, ("p",), ("y",)), initial_state="steady").fit(record)


def test_a_trial_step_without_a_steady_state_is_taken_back() -> None:
    """From p = 1 a Gauss-Newton step to x = sqrt(0.05) overshoots to p < 0, where there is no steady state."""
    record = toys.record(toys.square(), np.zeros(30), parameters={"p": 0.05}, x0=(0.05**0.5,), given=False)
    noisy = toys.measured_as(record, record.outputs + 0.01 * NOISE[:30])
    result = Pem(Setup(toys.square(), 1.0, ("p",), ("y",)), initial_state="steady").fit(noisy)
    assert result.status is Status.OK
    assert abs(result.values()[0] - 0.05) < 4 * result.estimates[0].std


def test_a_group_of_parameters_is_fitted_as_its_members(model: Model, cell_case: CellCase) -> None:
    """`floatability` is one parameter a mineral, in the order of the model."""
    names = model.expand_parameters(["floatability"])
    assert names == ("floatability.chalcopyrite", "floatability.quartz")
    outputs = np.vstack([s.outputs for s in cell_case.samples])
    record = Dataset("cell", np.arange(1.0, ROWS + 1), 1.0, cell_case.inputs, outputs)
    result = Pem(Setup(model, 1.0, names, ("concentrate_grade",))).fit(record)
    assert tuple(e.name for e in result.estimates) == names
    assert [e.unit for e in result.estimates] == ["-", "-"]


def test_a_search_that_runs_out_of_evaluations_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """The best values so far come with a status of their own, not with OK."""
    monkeypatch.setattr("estimators.pem.free_runs.MOST_EVALUATIONS", 1)
    model = toys.linear(2)
    record = toys.record(model, np.random.default_rng(3).normal(size=(30, 2)), parameters={"th0": 3.0, "th1": -2.0})
    setup = Setup(model, 1.0, model.names("parameters"), model.names("outputs"))
    result = Pem(setup, initial_state="given").fit(record)
    assert result.status is Status.NOT_CONVERGED and np.isfinite(result.values()).all()
