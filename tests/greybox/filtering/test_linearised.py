"""Log-likelihoods for other noise by the derivatives along one run: those of the filter itself for a linear model."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.greybox import Dataset, FloatArray, Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.filtering import NoiseModel, RecordFilter
from adaptive_flot.greybox.stepping.compiling.compiled import CompileError
from adaptive_flot.greybox.stepping.whole_record import tape_recursion

DT, ROWS = 1.0, 120
Case = tuple[NoiseModel, FloatArray, FloatArray, FloatArray]


def two_tanks(power: float) -> Model:
    """Two tanks in a row, what leaves a tank is a power of its level; linear for the power 1."""

    def equations(m: Scope) -> None:
        upper, lower = m.state("upper"), m.state("lower")
        k, p = m.parameter("k"), m.parameter("power")
        m.derivative("upper", m.input("u") - k * upper**p)
        m.derivative("lower", k * upper**p - k * lower**p)
        m.output("shown", lower)
        m.output("also", upper + lower)

    return Model(
        name="two-tanks",
        states=(Quantity("upper", "", "", scale=1.0), Quantity("lower", "", "", scale=1.0)),
        inputs=(Quantity("u", "", ""),),
        parameters=(Parameter("k", 0.2, "", "test"), Parameter("power", power, "", "test")),
        outputs=(Quantity("shown", "", "", scale=1.0), Quantity("also", "", "", scale=1.0)),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
    )


def record(seed: int) -> Dataset:
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(0.2, 0.6, ROWS // 10), 10)[:, None]
    y = 2.0 + np.cumsum(0.05 * rng.standard_normal((ROWS, 2)), axis=0)
    y[rng.random((ROWS, 2)) < 0.1] = np.nan
    return Dataset("tanks", DT * np.arange(ROWS, dtype=float), DT, u, y)


def case(model: Model, process: float, measured: float) -> Case:
    noise = NoiseModel({"upper": process, "lower": process}, {"shown": measured, "also": measured})
    return noise, np.array([2.0, 1.5]), process * np.eye(2), model.parameter_values


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 10**6),
    st.lists(st.tuples(st.floats(1e-3, 1.0), st.floats(1e-2, 1.0)), min_size=1, max_size=10),
    st.sampled_from([5.0, float("inf")]),
)
def test_a_linear_model_has_the_likelihoods_of_the_filter_itself(
    seed: int, sizes: list[tuple[float, float]], nu: float
) -> None:
    model, data = two_tanks(1.0), record(seed)
    own = RecordFilter(model, DT, (0, 1), (), nu)
    run = own.run(data, *case(model, 0.05, 0.1))
    cases = [case(model, *size) for size in sizes]
    each = np.array([own.run(data, *one).log_likelihood for one in cases])
    np.testing.assert_allclose(own.log_likelihoods_near(run, data, cases), each, rtol=1e-7, atol=1e-8)


def test_any_model_has_them_at_the_noise_of_the_run_and_nearly_beside_it() -> None:
    model, data = two_tanks(0.5), record(3)
    own = RecordFilter(model, DT, (0, 1))
    run = own.run(data, *case(model, 0.05, 0.1))
    same, beside = case(model, 0.05, 0.1), case(model, 0.06, 0.09)
    at, near = own.log_likelihoods_near(run, data, [same, beside])
    np.testing.assert_allclose(at, run.log_likelihood, rtol=1e-9, atol=1e-9)
    true = own.run(data, *beside).log_likelihood.sum()
    assert abs(near.sum() - true) < 0.1 * abs(true - run.log_likelihood.sum())


def test_one_row_and_a_machine_without_the_library_for_several(monkeypatch: pytest.MonkeyPatch) -> None:
    model, data = two_tanks(0.5), record(4)
    own, cases = RecordFilter(model, DT, (0, 1)), [case(model, 0.05 * k, 0.1) for k in range(1, 4)]
    run = own.run(data, *cases[0])
    before = own.log_likelihoods_near(run, data, cases)
    first = replace(data, time=data.time[:1], inputs=data.inputs[:1], outputs=data.outputs[:1])
    np.testing.assert_array_equal(own.log_likelihoods_near(own.run(first, *cases[0]), first, cases)[:, 0], before[:, 0])

    library = tape_recursion._library

    def fails(lanes: int) -> Any:
        if lanes == 1:
            return library(1)
        raise CompileError("no compiler")

    monkeypatch.setattr(tape_recursion, "_library", fails)
    np.testing.assert_allclose(own.log_likelihoods_near(run, data, cases), before, rtol=1e-12)
