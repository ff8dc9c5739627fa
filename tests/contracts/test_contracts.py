"""Every shipped estimator and controller keeps the contract; the kit itself notices a plug-in that does not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup
from adaptive_flot.plugins import CONTROLLERS, ESTIMATORS, load
from adaptive_flot.testing import (
    CONTROLLER_CHECKS,
    ESTIMATOR_CHECKS,
    ControllerCase,
    EstimatorCase,
    controller_case,
    estimator_case,
)
from estimators.fixed import Fixed, FixedState

ESTIMATOR_CASES: dict[str, tuple[str, dict[str, Any]]] = {name: (name, {}) for name in ESTIMATORS} | {
    "ekf-integrated": ("ekf", {"walk": "integrated"}),
    "mhe": ("mhe", {"window_s": 12, "solve_every_s": 4}),  # a window that fills and moves within the short record
    "rpem-central": ("rpem", {"gradient": "central"}),
    "rpem-never-frozen": ("rpem_full", {"freeze_s": None}),
    "rpem-corrected": ("rpem_full", {"correct_state": {"level": 5e-4, "tails_flow": 5e-7}}),
}


@pytest.mark.parametrize("name", ESTIMATOR_CASES)
@pytest.mark.parametrize("check", ESTIMATOR_CHECKS, ids=lambda c: str(c.__name__))
def test_estimator(name: str, check: Callable[[EstimatorCase], None]) -> None:
    address, options = ESTIMATOR_CASES[name]
    check(estimator_case(load(address, ESTIMATORS, "estimator"), **options))


@pytest.mark.parametrize("name", CONTROLLERS)
@pytest.mark.parametrize("check", CONTROLLER_CHECKS, ids=lambda c: str(c.__name__))
def test_controller(name: str, check: Callable[[ControllerCase], None]) -> None:
    check(controller_case(load(name, CONTROLLERS, "controller")))


@dataclass
class _Thawed:
    time: float


class _Bad(Fixed):
    """Breaks the contract in one chosen way."""

    def __init__(self, setup: Setup, *, fault: str) -> None:
        super().__init__(setup)
        self.fault = fault
        self.calls = 0
        self.takes_delayed_values = fault == "deaf"

    def init(self, prior: Prior) -> FixedState:
        return _Thawed(0.0) if self.fault == "thawed" else super().init(prior)  # type: ignore[return-value]

    def update(self, state: FixedState, sample: Sample) -> tuple[FixedState, Estimate]:
        self.calls += 1
        if self.fault == "mutates":
            state.theta[0] += 1.0
        new, estimate = super().update(state, sample)
        if self.fault == "forgetful":
            estimate = replace(estimate, parameters=estimate.parameters + 1e-15 * self.calls)
        if self.fault == "aliases":
            estimate = replace(estimate, state=new.x)
        if self.fault == "lopsided":
            estimate = replace(estimate, covariance=np.array([[1.0, 0.5], [0.0, 1.0]]))
        if self.fault == "wild":
            estimate = replace(estimate, parameters=estimate.parameters + 100.0)
        if self.fault == "peeks":
            estimate = replace(estimate, prediction=sample.outputs)
        return new, estimate


@pytest.mark.parametrize("fault", ["thawed", "mutates", "forgetful", "aliases", "lopsided", "wild", "peeks", "deaf"])
def test_the_kit_catches(fault: str) -> None:
    failures = 0
    for check in ESTIMATOR_CHECKS:
        try:
            check(estimator_case(_Bad, fault=fault))
        except (AssertionError, AttributeError):
            failures += 1
    assert failures > 0
