"""Every estimator with more sensors than the grade: air recovery and concentrate flow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.contracts import Estimate, Sample
from adaptive_flot.plugins import ESTIMATORS, load
from adaptive_flot.testing import EstimatorCase, estimator_case, run_estimator
from adaptive_flot.testing.measurements import MEASUREMENT_CHECKS
from tests.contracts.test_contracts import ESTIMATOR_CASES

GRADE = ("concentrate_grade",)
MORE = (*GRADE, "air_recovery", "concentrate_flow")
ADAPTING = sorted(set(ESTIMATOR_CASES) - {"fixed", "oracle"})


def case_of(name: str, outputs: tuple[str, ...]) -> EstimatorCase:
    address, options = ESTIMATOR_CASES[name]
    return estimator_case(load(address, ESTIMATORS, "estimator"), outputs=outputs, **options)


def estimates(case: EstimatorCase, samples: list[Sample]) -> list[Estimate]:
    return run_estimator(case.estimator, case.estimator.init(case.prior), samples)[1]


@pytest.mark.parametrize("name", ESTIMATORS)
def test_measurements_missing_late_and_at_several_rates(name: str) -> None:
    """The checks of the kit with three outputs that drive; the others do not depend on how many there are."""
    case = case_of(name, MORE)
    for check in MEASUREMENT_CHECKS:
        check(case)


@pytest.mark.parametrize("name", ADAPTING)
def test_sensors_that_are_silent_leave_the_estimates_of_the_grade_alone(name: str) -> None:
    """Reduction to a case with a known answer: nothing but the grade is ever measured."""
    alone, more = case_of(name, GRADE), case_of(name, MORE)
    j = more.estimator.setup.model.index("outputs", "concentrate_grade")
    first = more.samples[:25]
    silent = [replace(s, outputs=np.where(np.arange(s.outputs.size) == j, s.outputs, np.nan)) for s in first]
    for a, b in zip(estimates(more, silent), estimates(alone, silent), strict=True):
        np.testing.assert_allclose(a.parameters, b.parameters, rtol=1e-7)
        np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-5)
        np.testing.assert_allclose(a.state, b.state, rtol=1e-7)


@pytest.mark.parametrize("name", ADAPTING)
def test_more_sensors_make_the_estimates_surer(name: str) -> None:
    """They are used: n and C have less relative variance than with the grade alone, and sensors are predicted better.

    Better than with the nominal n, which is 2 % off at the end.
    """
    alone, more = (case_of(name, outputs) for outputs in (GRADE, MORE))
    less, tracked = (estimates(case, list(case.samples)) for case in (alone, more))
    surer, sure = (np.diag(run[-1].covariance) / run[-1].parameters ** 2 for run in (tracked, less))
    assert (surer < sure).all()
    driving = more.estimator.setup.model.indices("outputs", MORE)
    constant = estimates(case_of("fixed", MORE), list(more.samples))
    wrong, nominal = (np.array([e.innovation[driving] for e in run[-10:]]) for run in (tracked, constant))
    assert (np.abs(wrong).mean(axis=0) < 0.7 * np.abs(nominal).mean(axis=0)).all()
