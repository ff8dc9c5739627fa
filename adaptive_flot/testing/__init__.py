"""The contract kit: the same checks for every estimator and controller, shipped ones and a user's own.

In a user's test file::

    from adaptive_flot.testing import ESTIMATOR_CHECKS, estimator_case


    @pytest.mark.parametrize("check", ESTIMATOR_CHECKS, ids=lambda c: c.__name__)
    def test_contract(check):
        check(estimator_case(MyEstimator))

Cases are of the laboratory flotation cell; `estimator_case(MyEstimator, process=tanks_process())` is of the cascaded
tanks, and a `CaseProcess` of one's own is of any model.

A check raises `AssertionError` with what the contract asks for.
"""

from adaptive_flot.testing.cases import (
    ControllerCase,
    EstimatorCase,
    controller_case,
    estimator_case,
    run_controller,
    run_estimator,
)
from adaptive_flot.testing.controllers import CONTROLLER_CHECKS
from adaptive_flot.testing.estimators import ESTIMATOR_CHECKS
from adaptive_flot.testing.processes import CaseProcess, flotation_process, tanks_process

__all__ = [
    "CONTROLLER_CHECKS",
    "ESTIMATOR_CHECKS",
    "CaseProcess",
    "ControllerCase",
    "EstimatorCase",
    "controller_case",
    "estimator_case",
    "flotation_process",
    "run_controller",
    "run_estimator",
    "tanks_process",
]
