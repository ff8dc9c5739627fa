"""The contract kit: the same checks for every estimator and controller, shipped ones and a user's own.

In a user's test file::

    from adaptive_flot.testing import ESTIMATOR_CHECKS, estimator_case


    @pytest.mark.parametrize("check", ESTIMATOR_CHECKS, ids=lambda c: c.__name__)
    def test_contract(check):
        check(estimator_case(MyEstimator))

A check raises `AssertionError` with what the contract asks for.
"""

from __future__ import annotations

import copy
import dataclasses
import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from adaptive_flot.economics import Prices
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.steady_state import steady_state
from adaptive_flot.greybox.stepper import Stepper
from adaptive_flot.processes import flotation
from adaptive_flot.protocols import (
    AnyController,
    AnyEstimator,
    ControllerSetup,
    Decision,
    Estimate,
    Limits,
    Prior,
    Sample,
    Setup,
    Status,
)

ROWS = 40
NOISE_STD = 1e-3


@dataclass(frozen=True)
class EstimatorCase:
    """An estimator, where it starts, and a short record of the laboratory cell with drifting n."""

    estimator: AnyEstimator
    prior: Prior
    samples: tuple[Sample, ...]


@dataclass(frozen=True)
class ControllerCase:
    """A controller, and samples with the estimates to decide on (true state, nominal parameters)."""

    controller: AnyController
    setup: ControllerSetup
    samples: tuple[Sample, ...]
    estimates: tuple[Estimate, ...]


def estimator_case(factory: Callable[..., AnyEstimator], seed: int = 1, **options: Any) -> EstimatorCase:
    """Build a case for an estimator class or factory, called as `factory(setup, **options)`."""
    setup = Setup(flotation.make_model(), dt=1.0)
    inputs, samples, _ = _record(setup, seed)
    nominal = setup.model.parameter_values[setup.model.indices("parameters", setup.parameters)]
    prior = Prior(
        time=0.0,
        state=steady_state(setup.model, inputs[0]).state,
        parameters=nominal,
        covariance=np.diag((0.02 * nominal) ** 2),
        noise_std=np.full(len(setup.outputs), NOISE_STD),
    )
    return EstimatorCase(factory(setup, **options), prior, samples)


def controller_case(factory: Callable[..., AnyController], seed: int = 1, **options: Any) -> ControllerCase:
    """Build a case for a controller class or factory, called as `factory(setup, **options)`."""
    setup = Setup(flotation.make_model(), dt=1.0)
    inputs, samples, states = _record(setup, seed)
    nominal = setup.model.parameter_values[setup.model.indices("parameters", setup.parameters)]
    limits = Limits(
        grade=0.20,
        level=(0.33, 0.42),
        inputs={"air_flow": (9.05e-4, 2.17e-3), "level_setpoint": (0.33, 0.42)},
        moves={"air_flow": 2e-4, "level_setpoint": 0.01},
    )
    controller_setup = ControllerSetup(setup.model, setup.dt, inputs, setup.parameters, limits, Prices())
    estimates = tuple(
        Estimate(
            time=sample.time,
            prediction=sample.outputs,
            innovation=np.zeros_like(sample.outputs),
            innovation_std=np.full(len(setup.outputs), NOISE_STD),
            parameters=nominal,
            covariance=np.diag((0.02 * nominal) ** 2),
            state=state,
            status=Status.OK,
        )
        for sample, state in zip(samples, states, strict=True)
    )
    return ControllerCase(factory(controller_setup, **options), controller_setup, samples, estimates)


def _record(setup: Setup, seed: int) -> tuple[FloatArray, tuple[Sample, ...], FloatArray]:
    generator = np.random.default_rng(seed)
    model = setup.model
    inputs = np.tile([1.5e-3, 1.67e-4, 0.38], (ROWS, 1))
    inputs[ROWS // 2 :, 0], inputs[ROWS // 4 :, 2] = 1.7e-3, 0.36
    p = np.tile(model.parameter_values, (ROWS, 1))
    p[:, model.index("parameters", "n")] *= np.linspace(1.0, 1.02, ROWS)
    run = Stepper(model, setup.dt).simulate(steady_state(model, inputs[0]).state, inputs, p)
    outputs = run.outputs * (1 + 1e-3 * generator.standard_normal(run.outputs.shape))
    samples = (Sample(float(t), u, y) for t, u, y in zip(run.time, inputs, outputs, strict=True))
    return inputs, tuple(samples), run.states


# -- estimators ----------------------------------------------------------------------------------------------------


def run_estimator(estimator: AnyEstimator, state: Any, samples: Sequence[Sample]) -> tuple[Any, list[Estimate]]:
    """Replay samples; the last state and every estimate."""
    estimates = []
    for sample in samples:
        state, estimate = estimator.update(state, sample)
        estimates.append(estimate)
    return state, estimates


def check_state_is_frozen(case: EstimatorCase) -> None:
    """The state is a frozen dataclass: nobody can change it behind the estimator's back."""
    _frozen(case.estimator.init(case.prior))


def check_inputs_are_not_changed(case: EstimatorCase) -> None:
    """Prior, state and sample are the same after the calls as before."""
    before = copy.deepcopy((case.prior, case.samples))
    state = case.estimator.init(case.prior)
    kept = copy.deepcopy(state)
    case.estimator.update(state, case.samples[0])
    assert _same(kept, state), "update changed the state that it was given; return a new one"
    assert _same(before, (case.prior, case.samples)), "init or update changed the prior or the sample"


def check_results_share_no_memory(case: EstimatorCase) -> None:
    """What update returns does not alias what it was given, so that a caller may keep and change it."""
    state = case.estimator.init(case.prior)
    new, estimate = case.estimator.update(state, case.samples[0])
    inner = [*_arrays(state), case.samples[0].inputs, case.samples[0].outputs]
    for array in _arrays(estimate):
        assert not any(np.shares_memory(array, a) for a in (*inner, *_arrays(new))), "the estimate aliases the state"


def check_deterministic(case: EstimatorCase) -> None:
    """The same samples give the same estimates, to the bit."""
    first = run_estimator(case.estimator, case.estimator.init(case.prior), case.samples)
    second = run_estimator(case.estimator, case.estimator.init(case.prior), case.samples)
    assert _same(first, second), "two replays of one record differ"


def check_resumable_at_any_step(case: EstimatorCase) -> None:
    """A pickled state goes on exactly where it was, to the bit, from every step."""
    state = case.estimator.init(case.prior)
    _, whole = run_estimator(case.estimator, state, case.samples)
    for k in range(len(case.samples)):
        _, rest = run_estimator(case.estimator, pickle.loads(pickle.dumps(state)), case.samples[k : k + 3])
        assert _same(whole[k : k + 3], rest), f"resumed at step {k} the estimates differ from the uninterrupted run"
        state, _ = case.estimator.update(state, case.samples[k])


def check_state_does_not_grow(case: EstimatorCase) -> None:
    """The state takes no more memory after many samples than after a few."""
    state, _ = run_estimator(case.estimator, case.estimator.init(case.prior), case.samples[: ROWS // 2])
    size = len(pickle.dumps(state))
    state, _ = run_estimator(case.estimator, state, case.samples[ROWS // 2 :])
    assert len(pickle.dumps(state)) <= size + 64, "the state grows with the record"


def check_missing_measurement_is_a_status(case: EstimatorCase) -> None:
    """Without a measurement the estimator predicts only, says so, and goes on with the next sample."""
    state, _ = case.estimator.update(case.estimator.init(case.prior), case.samples[0])
    missing = replace(case.samples[1], outputs=np.full_like(case.samples[1].outputs, np.nan))
    after, estimate = case.estimator.update(state, missing)
    assert estimate.status is not Status.OK, "a missing measurement must give a status"
    assert np.isfinite(estimate.prediction).all() and np.isfinite(estimate.parameters).all()
    assert np.isnan(estimate.innovation).all(), "there is no innovation without a measurement"
    _, following = case.estimator.update(after, case.samples[2])
    assert np.isfinite(following.parameters).all() and following.status is Status.OK


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
    assert np.allclose(a.prediction + a.innovation, case.samples[0].outputs, equal_nan=True, rtol=1e-12)


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
    check_missing_measurement_is_a_status,
    check_covariance,
    check_bounds_are_kept,
    check_prediction_comes_before_the_measurement,
    check_wrong_shape_is_a_named_error,
)


# -- controllers ---------------------------------------------------------------------------------------------------


def run_controller(
    case: ControllerCase, state: Any, samples: Sequence[Sample | None], estimates: Sequence[Estimate | None]
) -> tuple[Any, list[Decision]]:
    """Ask for a decision on each sample with its estimate; the last state and every decision."""
    decisions = []
    for sample, estimate in zip(samples, estimates, strict=True):
        state, decision = case.controller.decide(state, sample, estimate)
        decisions.append(decision)
    return state, decisions


def check_controller_state_is_frozen(case: ControllerCase) -> None:
    """The state is a frozen dataclass."""
    _frozen(case.controller.init(0.0))


def check_controller_decides_within_bounds(case: ControllerCase) -> None:
    """Inputs are finite and within the model's range, from the first decision on, also without a measurement."""
    lost = replace(case.samples[-1], outputs=np.full_like(case.samples[-1].outputs, np.nan))
    blind = replace(case.estimates[-1], innovation=lost.outputs, status=Status.MISSING)
    samples, estimates = [None, *case.samples, lost], [None, *case.estimates, blind]
    _, decisions = run_controller(case, case.controller.init(0.0), samples, estimates)
    for decision in decisions:
        case.setup.model.check_inputs(decision.inputs)
        assert decision.decided_by, "a decision says who took it"


def check_controller_is_deterministic_and_resumable(case: ControllerCase) -> None:
    """The same samples give the same inputs to the bit, also from a pickled state in the middle."""
    samples, estimates = [None, *case.samples], [None, *case.estimates]
    _, whole = run_controller(case, case.controller.init(0.0), samples, estimates)
    middle, first = run_controller(case, case.controller.init(0.0), samples[:7], estimates[:7])
    _, rest = run_controller(case, pickle.loads(pickle.dumps(middle)), samples[7:], estimates[7:])
    assert _same([d.inputs for d in whole], [d.inputs for d in (*first, *rest)]), "decisions differ after a resume"


def check_controller_inputs_are_not_changed(case: ControllerCase) -> None:
    """Setup, state and sample are the same after a decision; the decision aliases none of them."""
    state = case.controller.init(0.0)
    kept = copy.deepcopy((state, case.samples, case.estimates, case.setup.schedule))
    after, decision = case.controller.decide(state, case.samples[0], case.estimates[0])
    later = copy.deepcopy(after)
    decision.inputs[:] = 0.0
    assert _same(kept, (state, case.samples, case.estimates, case.setup.schedule)), "a decision changed its arguments"
    assert _same(later, after), "the decision aliases the state"


CONTROLLER_CHECKS: tuple[Callable[[ControllerCase], None], ...] = (
    check_controller_state_is_frozen,
    check_controller_decides_within_bounds,
    check_controller_is_deterministic_and_resumable,
    check_controller_inputs_are_not_changed,
)


# -- comparing -----------------------------------------------------------------------------------------------------


def _frozen(state: Any) -> None:
    assert dataclasses.is_dataclass(state), "the state must be a dataclass"
    field = dataclasses.fields(state)[0].name
    try:
        setattr(state, field, None)
    except dataclasses.FrozenInstanceError:
        return
    raise AssertionError("the state must be a frozen dataclass")


def _arrays(value: Any) -> list[FloatArray]:
    fields = [getattr(value, f.name) for f in dataclasses.fields(value)]
    return [f for f in fields if isinstance(f, np.ndarray)]


def _same(a: Any, b: Any) -> bool:
    """Equal to the bit, through dataclasses and sequences, NaN equal to NaN."""
    if isinstance(a, np.ndarray):
        return bool(isinstance(b, np.ndarray) and np.array_equal(a, b, equal_nan=True))
    if dataclasses.is_dataclass(a):
        return type(a) is type(b) and all(_same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    return bool(a == b) or (isinstance(a, float) and isinstance(b, float) and np.isnan(a) and np.isnan(b))
