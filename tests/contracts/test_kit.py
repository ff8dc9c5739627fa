"""The kit notices a plug-in that breaks the contract, by the check that is named for it; no check is without one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.contracts import ControllerSetup, Decision, Estimate, Prior, Sample, Setup, Status
from adaptive_flot.errors import ModelError
from adaptive_flot.testing import CONTROLLER_CHECKS, ESTIMATOR_CHECKS, controller_case, estimator_case, tanks_process
from controllers.hold import Hold, HoldState
from estimators.fixed import Fixed, FixedState

BAD_ESTIMATORS = {
    "state can be changed": ["check_state_is_frozen"],
    "changes its state": ["check_inputs_are_not_changed"],
    "returns its own array": ["check_results_share_no_memory"],
    "counts its calls": ["check_deterministic", "check_resumable_at_any_step"],
    "keeps every sample": ["check_state_does_not_grow"],
    "covariance is not symmetric": ["check_covariance"],
    "leaves the bounds": ["check_bounds_are_kept"],
    "predicts with the sample": ["check_prediction_comes_before_the_measurement"],
    "takes any shape": ["check_wrong_shape_is_a_named_error"],
    "is always fine": ["check_missing_measurement_is_a_status", "check_several_rates"],
    "ignores delayed values": [
        "check_delayed_value_is_as_good_as_one_in_time",
        "check_delayed_value_without_a_sample_is_a_status",
    ],
}
"""What an estimator does wrong, and the checks that must catch it."""
BAD_CONTROLLERS = {
    "state can be changed": ["check_controller_state_is_frozen"],
    "leaves the range": ["check_controller_decides_within_bounds"],
    "does not say who decided": ["check_controller_decides_within_bounds"],
    "counts its calls": ["check_controller_is_deterministic_and_resumable"],
    "returns the schedule": ["check_controller_inputs_are_not_changed"],
}


@dataclass
class _Changeable:
    time: float


@dataclass(frozen=True)
class _Growing(FixedState):
    samples: tuple[Sample, ...] = ()


class BadEstimator(Fixed):
    """Breaks the contract in one chosen way."""

    def __init__(self, setup: Setup, *, fault: str) -> None:
        super().__init__(setup)
        self.fault = fault
        self.calls = 0
        self.takes_delayed_values = fault == "ignores delayed values"

    def init(self, prior: Prior) -> Any:
        state = super().init(prior)
        if self.fault == "state can be changed":
            return _Changeable(0.0)
        return _Growing(**vars(state)) if self.fault == "keeps every sample" else state

    def update(self, state: Any, sample: Sample) -> tuple[Any, Estimate]:
        self.calls += 1
        if self.fault == "changes its state":
            state.theta[0] += 1.0
        if self.fault == "takes any shape":
            model = self.setup.model
            u, y = np.resize(sample.inputs, len(model.inputs)), np.resize(sample.outputs, len(model.outputs))
            sample = replace(sample, inputs=u, outputs=y)
        new, estimate = super().update(state, sample)
        if isinstance(new, _Growing):
            new = replace(new, samples=(*new.samples, sample))
        return new, self._spoiled(new, estimate, sample)

    def _spoiled(self, new: FixedState, estimate: Estimate, sample: Sample) -> Estimate:
        q = len(estimate.parameters)
        wrong: dict[str, dict[str, Any]] = {
            "counts its calls": {"parameters": estimate.parameters * (1 + 1e-15 * self.calls)},
            "returns its own array": {"state": new.x},
            "covariance is not symmetric": {"covariance": np.triu(np.ones((q, q)))},
            "leaves the bounds": {"parameters": estimate.parameters + 100.0},
            "predicts with the sample": {"prediction": sample.outputs},
            "is always fine": {"status": Status.OK},
        }
        return replace(estimate, **wrong.get(self.fault, {}))


class BadController(Hold):
    """Breaks the contract in one chosen way."""

    def __init__(self, setup: ControllerSetup, *, fault: str) -> None:
        super().__init__(setup)
        self.fault = fault
        self.calls = 0

    def init(self, time: float) -> Any:
        return _Changeable(time) if self.fault == "state can be changed" else super().init(time)

    def decide(self, state: HoldState, sample: Sample | None, estimate: Estimate | None) -> tuple[HoldState, Decision]:
        self.calls += 1
        state, decision = super().decide(state, sample, estimate)
        wrong: dict[str, dict[str, Any]] = {
            "leaves the range": {"inputs": decision.inputs * 100.0},
            "does not say who decided": {"decided_by": ""},
            "counts its calls": {"inputs": decision.inputs * (1 + 1e-15 * self.calls)},
            "returns the schedule": {"inputs": self.setup.schedule[0]},
        }
        return state, replace(decision, **wrong.get(self.fault, {}))


def failing(checks: Any, case: Any) -> list[str]:
    """Names of the checks that say what is wrong; others may end in whatever a broken plug-in raises."""
    names = []
    for check in checks:
        try:
            check(case())
        except AssertionError as error:
            assert str(error)
            names.append(check.__name__)
        except (AttributeError, ModelError, TypeError):
            continue
    return names


@pytest.mark.parametrize("fault", BAD_ESTIMATORS)
def test_the_named_check_catches_the_estimator(fault: str) -> None:
    caught = failing(ESTIMATOR_CHECKS, lambda: estimator_case(BadEstimator, process=tanks_process(), fault=fault))
    assert set(BAD_ESTIMATORS[fault]) <= set(caught)


@pytest.mark.parametrize("fault", BAD_CONTROLLERS)
def test_the_named_check_catches_the_controller(fault: str) -> None:
    caught = failing(CONTROLLER_CHECKS, lambda: controller_case(BadController, process=tanks_process(), fault=fault))
    assert set(BAD_CONTROLLERS[fault]) <= set(caught)


def test_every_check_has_a_plug_in_that_it_must_catch() -> None:
    for checks, bad in ((ESTIMATOR_CHECKS, BAD_ESTIMATORS), (CONTROLLER_CHECKS, BAD_CONTROLLERS)):
        assert {c.__name__ for c in checks} == {name for names in bad.values() for name in names}


def test_a_sound_plug_in_is_not_caught() -> None:
    """The two that the bad ones are made of."""
    assert failing(ESTIMATOR_CHECKS, lambda: estimator_case(Fixed, process=tanks_process())) == []
    assert failing(CONTROLLER_CHECKS, lambda: controller_case(Hold, process=tanks_process())) == []
