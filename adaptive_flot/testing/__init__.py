"""The contract kit: the same checks for every estimator and controller, shipped ones and a user's own.

In a user's test file::

    from adaptive_flot.testing import ESTIMATOR_CHECKS, estimator_case


    @pytest.mark.parametrize("check", ESTIMATOR_CHECKS, ids=lambda c: c.__name__)
    def test_contract(check):
        check(estimator_case(MyEstimator))

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

__all__ = [
    "CONTROLLER_CHECKS",
    "ESTIMATOR_CHECKS",
    "ControllerCase",
    "EstimatorCase",
    "controller_case",
    "estimator_case",
    "run_controller",
    "run_estimator",
]
