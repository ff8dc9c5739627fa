"""Where a fit starts and when it rests: never further from the record than what was given, never worse than before."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.discovery.descent import SHARES, Descent
from adaptive_flot.discovery.fit import Fit
from adaptive_flot.discovery.fitter import Fitter
from adaptive_flot.discovery.problem import Problem, make_problem
from adaptive_flot.discovery.unknowns import Unknowns
from adaptive_flot.greybox.effects import Effect
from tests.discovery.heated import EXPONENT, heated_tank, tank_record

ADAPTED = ("efficiency", "loss")
DRAUGHT = Effect("heat_loss", "fan_speed", "power", settings={"reference": 10.0})
EXPONENT_NAME = "heat_loss_by_fan_speed.exponent"


@pytest.fixture(scope="module")
def base() -> tuple[Problem, Fit]:
    problem = make_problem(tank_record(), heated_tank(), ADAPTED, burn_in=30, guard=5)
    fit = Fitter(problem).fit(heated_tank())
    assert fit is not None
    return problem, fit


@settings(max_examples=15, deadline=None)
@given(exponent=st.floats(-9.0, 9.0))
def test_a_start_is_shrunk_to_the_share_that_is_nearest(base: tuple[Problem, Fit], exponent: float) -> None:
    problem, fit = base
    model = fit.model.with_effects([DRAUGHT])

    def descent(value: float) -> Descent:
        unknowns = Unknowns(problem, model, (EXPONENT_NAME,), {EXPONENT_NAME: value}, fit, {})
        return Descent(problem, Fitter(problem).rows, model, unknowns)

    def distance(d: Descent) -> float:
        return d._objective(d.unknowns.centre, d._predict(d.unknowns.centre), d._first_noise())

    shrunk = descent(exponent)
    shrunk.shrink([EXPONENT_NAME])
    assert distance(shrunk) == pytest.approx(min(distance(descent(share * exponent)) for share in SHARES))


@pytest.mark.parametrize("start", [6.0, -6.0])
def test_a_start_that_is_far_too_large_still_comes_to_the_truth(base: tuple[Problem, Fit], start: float) -> None:
    problem, fit = base
    model = fit.model.with_effects([DRAUGHT])
    found = Fitter(problem).fit(model, (EXPONENT_NAME,), {EXPONENT_NAME: start}, fit, shrink=(EXPONENT_NAME,))
    assert found is not None
    assert dict(zip(found.names, found.values, strict=True))[EXPONENT_NAME] == pytest.approx(EXPONENT, abs=0.03)


def test_a_settled_fit_is_no_worse_and_stays(base: tuple[Problem, Fit]) -> None:
    problem, fit = base
    fitter = Fitter(problem)
    rough = fitter.fit(heated_tank(), rounds=1, steps=1)
    assert rough is not None
    settled = fitter.settled(rough)
    assert settled.loss <= rough.loss
    assert settled.loss == pytest.approx(fit.loss, abs=1.0)
    assert fitter.settled(settled).loss <= settled.loss
    np.testing.assert_allclose(fitter.settled(settled).values, settled.values, rtol=1e-3)
