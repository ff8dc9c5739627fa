"""Delayed values: whatever arrives within the window, the estimate is that of a record with everything in time."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.contracts import DelayedValue, Estimate, Prior, Sample, Setup, Status
from adaptive_flot.contracts.delayed_measurements import DelayedMeasurements, in_time
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from estimators.rpem.estimator import Rpem
from tests.estimators import toys

ROWS = 40


def linear_setup() -> Setup:
    model = toys.linear(2, 2)
    return Setup(model, 1.0, model.names("parameters"), model.names("outputs"))


def make_samples(seed: int) -> list[Sample]:
    generator = np.random.default_rng(seed)
    inputs = generator.normal(size=(ROWS, 4))
    outputs = inputs.reshape(ROWS, 2, 2) @ np.array([1.0, -0.5]) + 0.1 * generator.normal(size=(ROWS, 2))
    return [Sample(k + 1.0, u, y) for k, (u, y) in enumerate(zip(inputs, outputs, strict=True))]


def delayed(samples: list[Sample], delays: FloatArray) -> list[Sample]:
    """The same record in which the value of y1 at sample k is known delays[k] samples later; 0: in time."""
    delayed: dict[int, list[DelayedValue]] = {}
    shown = list(samples)
    for k, delay in enumerate(delays):
        if delay > 0:
            shown[k] = replace(samples[k], outputs=np.array([samples[k].outputs[0], np.nan]))
            delayed.setdefault(k + int(delay), []).append(DelayedValue("y1", k + 1.0, samples[k].outputs[1]))
    return [replace(s, delayed=tuple(delayed.get(k, ()))) for k, s in enumerate(shown)]


def run(estimator: DelayedMeasurements | Rpem, samples: list[Sample]) -> list[Estimate]:
    state = estimator.init(Prior(0.0, np.zeros(1), np.zeros(2), np.eye(2), np.full(2, 0.1)))
    estimates = []
    for sample in samples:
        state, estimate = estimator.update(state, sample)  # type: ignore[arg-type]
        estimates.append(estimate)
    return estimates


@given(seed=st.integers(0, 10**6), delays=st.lists(st.integers(0, 8), min_size=ROWS - 9, max_size=ROWS - 9))
def test_in_whatever_order_values_arrive_the_last_estimate_is_that_of_the_whole_record(
    seed: int, delays: list[int]
) -> None:
    samples = make_samples(seed)
    shown = delayed(samples, np.array(delays + [0] * 9))
    estimator = DelayedMeasurements(Rpem(linear_setup(), forgetting=0.95), 10.0)
    estimates, expected = run(estimator, shown)[-1], run(Rpem(linear_setup(), forgetting=0.95), samples)[-1]
    np.testing.assert_array_equal(estimates.parameters, expected.parameters)
    np.testing.assert_array_equal(estimates.covariance, expected.covariance)
    np.testing.assert_array_equal([s.outputs for s in in_time(shown, linear_setup())], [s.outputs for s in samples])


def test_a_value_older_than_the_window_is_refused_and_one_just_inside_is_used() -> None:
    samples = make_samples(1)
    for age, status in ((5, Status.DELAYED), (6, Status.TOO_OLD)):
        shown = list(samples)
        shown[20] = replace(samples[20], delayed=(DelayedValue("y1", samples[20].time - age, 9.0),))
        assert run(DelayedMeasurements(Rpem(linear_setup()), 5.0), shown)[20].status is status


def test_a_delayed_value_of_the_sample_itself_is_a_plain_measurement() -> None:
    samples = make_samples(2)
    shown = list(samples)
    alone = np.array([samples[7].outputs[0], np.nan])
    value = DelayedValue("y1", samples[7].time, samples[7].outputs[1])
    shown[7] = replace(samples[7], outputs=alone, delayed=(value,))
    estimates, expected = run(DelayedMeasurements(Rpem(linear_setup()), 5.0), shown), run(Rpem(linear_setup()), samples)
    for a, b in zip(estimates, expected, strict=True):
        np.testing.assert_array_equal(a.parameters, b.parameters)
        assert a.status is b.status


def test_a_delayed_value_that_is_not_a_number_is_a_missing_one() -> None:
    samples = make_samples(3)
    shown = list(samples)
    shown[9] = replace(samples[9], delayed=(DelayedValue("y0", 5.0, np.nan),))
    for a, b in zip(
        run(DelayedMeasurements(Rpem(linear_setup()), 9.0), shown), run(Rpem(linear_setup()), samples), strict=True
    ):
        np.testing.assert_array_equal(a.parameters, b.parameters)
        assert a.status is b.status


def test_a_delayed_value_of_an_unknown_output_is_a_named_error() -> None:
    samples = make_samples(4)
    samples[5] = replace(samples[5], delayed=(DelayedValue("y7", 3.0, 1.0),))
    with pytest.raises(ModelError, match="y7"):
        run(DelayedMeasurements(Rpem(linear_setup()), 9.0), samples)


def test_memory_stays_within_the_window() -> None:
    estimator = DelayedMeasurements(Rpem(linear_setup()), 8.0)
    state = estimator.init(Prior(0.0, np.zeros(1), np.zeros(2), np.eye(2), np.full(2, 0.1)))
    sizes = []
    for sample in make_samples(5):
        state, _ = estimator.update(state, sample)
        sizes.append(len(pickle.dumps(state)))
    assert max(sizes[8:]) <= sizes[8] + 64
