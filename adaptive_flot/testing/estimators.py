"""Checks of an estimator."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from adaptive_flot.errors import ModelError
from adaptive_flot.testing.cases import EstimatorCase, run_estimator
from adaptive_flot.testing.comparing import arrays, assert_frozen, same
from adaptive_flot.testing.measurements import MEASUREMENT_CHECKS
from adaptive_flot.testing.processes import ROWS


def check_state_is_frozen(case: EstimatorCase) -> None:
    """The state is a frozen dataclass: nobody can change it behind the estimator's back."""
    assert_frozen(case.estimator.init(case.prior))


def check_inputs_are_not_changed(case: EstimatorCase) -> None:
    """Prior, state and sample are the same after the calls as before."""
    before = copy.deepcopy((case.prior, case.samples))
    state = case.estimator.init(case.prior)
    kept = copy.deepcopy(state)
    case.estimator.update(state, case.samples[0])
    assert same(kept, state), "update changed the state that it was given; return a new one"
    assert same(before, (case.prior, case.samples)), "init or update changed the prior or the sample"


def check_results_share_no_memory(case: EstimatorCase) -> None:
    """What update returns does not alias what it was given, so that a caller may keep and change it."""
    state = case.estimator.init(case.prior)
    new, estimate = case.estimator.update(state, case.samples[0])
    inner = [*arrays(state), case.samples[0].inputs, case.samples[0].outputs]
    for array in arrays(estimate):
        assert not any(np.shares_memory(array, a) for a in (*inner, *arrays(new))), "the estimate aliases the state"


def check_deterministic(case: EstimatorCase) -> None:
    """The same samples give the same estimates, to the bit."""
    first = run_estimator(case.estimator, case.estimator.init(case.prior), case.samples)
    second = run_estimator(case.estimator, case.estimator.init(case.prior), case.samples)
    assert same(first, second), "two replays of one record differ"


def check_resumable_at_any_step(case: EstimatorCase) -> None:
    """A pickled state goes on exactly where it was, to the bit, from every step."""
    state = case.estimator.init(case.prior)
    _, whole = run_estimator(case.estimator, state, case.samples)
    for k in range(len(case.samples)):
        _, rest = run_estimator(case.estimator, pickle.loads(pickle.dumps(state)), case.samples[k : k + 3])
        assert same(whole[k : k + 3], rest), f"resumed at step {k} the estimates differ from the uninterrupted run"
        state, _ = case.estimator.update(state, case.samples[k])


def check_state_does_not_grow(case: EstimatorCase) -> None:
    """The state takes no more memory after many samples than after a few."""
    state, _ = run_estimator(case.estimator, case.estimator.init(case.prior), case.samples[: ROWS // 2])
    size = len(pickle.dumps(state))
    state, _ = run_estimator(case.estimator, state, case.samples[ROWS // 2 :])
    assert len(pickle.dumps(state)) <= size + 64, "the state grows with the record"


def check_covariance(case: EstimatorCase) -> None:
    """The covariance is finite, symmetric and positive semi-definite at every step."""
    _, estimates = run_estimator(case.estimator, case.estimator.init(case.prior), case.samples)
    for e in estimates:
        assert np.isfinite(e.covariance).all() and np.array_equal(e.covariance, e.covariance.T), "not symmetric"
        std = np.sqrt(np.maximum(np.diag(e.covariance), 1e-300))
        lowest = np.linalg.eigvalsh(e.covariance / np.outer(std, std)).min()
        assert lowest > -1e-10, "the covariance has a negative eigenvalue"


def check_bounds_are_kept(case: EstimatorCase) -> None:
    """Whatever is measured, estimates stay within the physical range of their parameters."""
    model = case.estimator.setup.model
    parameters = [model.parameters[i] for i in model.indices("parameters", case.estimator.setup.parameters)]
    for absurd in (-1e3, 1e3):
        wild = [replace(s, outputs=np.full_like(s.outputs, absurd)) for s in case.samples[:10]]
        _, estimates = run_estimator(case.estimator, case.estimator.init(case.prior), wild)
        for e in estimates:
            for p, value in zip(parameters, e.parameters, strict=True):
                assert p.lower <= value <= p.upper, f"{p.name} = {value:g} left [{p.lower:g}, {p.upper:g}]"


def check_prediction_comes_before_the_measurement(case: EstimatorCase) -> None:
    """The prediction of a sample does not use that sample."""
    state = case.estimator.init(case.prior)
    other = replace(case.samples[0], outputs=case.samples[0].outputs * 1.01)
    _, a = case.estimator.update(state, case.samples[0])
    _, b = case.estimator.update(state, other)
    assert np.array_equal(a.prediction, b.prediction), "the prediction depends on the sample it predicts"
    added = np.allclose(a.prediction + a.innovation, case.samples[0].outputs, equal_nan=True, rtol=1e-12)
    assert added, "prediction and innovation do not add up to the measurement"


def check_wrong_shape_is_a_named_error(case: EstimatorCase) -> None:
    """A vector of the wrong length raises ModelError, not something from deep inside."""
    state = case.estimator.init(case.prior)
    for wrong in (
        replace(case.samples[0], inputs=case.samples[0].inputs[:-1]),
        replace(case.samples[0], outputs=case.samples[0].outputs[:-1]),
    ):
        try:
            case.estimator.update(state, wrong)
        except ModelError:
            continue
        raise AssertionError("a sample of the wrong shape must raise ModelError")


ESTIMATOR_CHECKS: tuple[Callable[[EstimatorCase], None], ...] = (
    check_state_is_frozen,
    check_inputs_are_not_changed,
    check_results_share_no_memory,
    check_deterministic,
    check_resumable_at_any_step,
    check_state_does_not_grow,
    check_covariance,
    check_bounds_are_kept,
    check_prediction_comes_before_the_measurement,
    check_wrong_shape_is_a_named_error,
    *MEASUREMENT_CHECKS,
)
