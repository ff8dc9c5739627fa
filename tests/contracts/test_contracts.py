"""Every shipped estimator and controller keeps the contract, on the flotation cell and on another process."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import pytest

from adaptive_flot.plugins import CONTROLLERS, ESTIMATORS, load
from adaptive_flot.testing import (
    CONTROLLER_CHECKS,
    ESTIMATOR_CHECKS,
    ControllerCase,
    EstimatorCase,
    controller_case,
    estimator_case,
    tanks_process,
)

ESTIMATOR_CASES: dict[str, tuple[str, dict[str, Any]]] = {name: (name, {}) for name in ESTIMATORS} | {
    "ekf-integrated": ("ekf", {"walk": "integrated"}),
    "mhe": ("mhe", {"window_s": 12, "solve_every_s": 4}),  # a window that fills and moves within the short record
    "rpem-central": ("rpem", {"gradient": "central"}),
    "rpem-never-frozen": ("rpem_full", {"freeze_s": None}),
    "rpem-corrected": ("rpem_full", {"correct_state": {"level": 5e-4, "tails_flow": 5e-7}}),
}


@cache
def estimator_on_the_cell(name: str) -> EstimatorCase:
    """Built once for all checks: what changes is passed in and handed back, so that none can spoil it for the next."""
    address, options = ESTIMATOR_CASES[name]
    return estimator_case(load(address, ESTIMATORS, "estimator"), **options)


@cache
def controller_on_the_cell(name: str) -> ControllerCase:
    return controller_case(load(name, CONTROLLERS, "controller"))


@pytest.mark.parametrize("name", ESTIMATOR_CASES)
@pytest.mark.parametrize("check", ESTIMATOR_CHECKS, ids=lambda c: str(c.__name__))
def test_estimator(name: str, check: Callable[[EstimatorCase], None]) -> None:
    check(estimator_on_the_cell(name))


@pytest.mark.parametrize("name", CONTROLLERS)
@pytest.mark.parametrize("check", CONTROLLER_CHECKS, ids=lambda c: str(c.__name__))
def test_controller(name: str, check: Callable[[ControllerCase], None]) -> None:
    check(controller_on_the_cell(name))


TANK_ESTIMATORS = {name: case for name, case in ESTIMATOR_CASES.items() if name != "rpem-corrected"}
"""Without the one whose options name sensors of the cell."""


@pytest.mark.parametrize("name", TANK_ESTIMATORS)
def test_estimator_on_another_process(name: str) -> None:
    """All checks of the kit on the cascaded tanks, which have another sampling interval and a single output."""
    address, options = TANK_ESTIMATORS[name]
    case = estimator_case(load(address, ESTIMATORS, "estimator"), process=tanks_process(), **options)
    for check in ESTIMATOR_CHECKS:
        check(case)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_controller_on_another_process(name: str) -> None:
    case = controller_case(load(name, CONTROLLERS, "controller"), process=tanks_process())
    for check in CONTROLLER_CHECKS:
        check(case)
