"""Protects: a part that is shut for most of the time, and leaks, is scored and fitted though no small change shows."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.discovery.candidates.dynamics import bounded
from adaptive_flot.discovery.candidates.responses import Responses, TimeProfile
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import Problem, make_problem
from adaptive_flot.discovery.search.alternatives import with_hidden
from adaptive_flot.greybox.model import FloatArray
from tests.discovery.heated import CAPACITY, DT, ROOM, Truth, heated_tank, moves, tank_record

ROWS, LEAK = 400, 300.0
SHUT = moves(ROWS, 0.0, 1.0, 20, 1) < 0.7
POWER = np.where(SHUT, 0.0, moves(ROWS, 500.0, 3000.0, 20, 2))


@pytest.fixture(scope="module")
def tank() -> tuple[Problem, Fit, Responses]:
    """A tank whose heater lets 300 W through when it is shut, and the model as it is, fitted."""
    inputs = np.column_stack([np.maximum(POWER, LEAK), np.full(ROWS, 10.0)])
    record = tank_record(Truth(exponent=0.0), ROWS, 3, inputs)
    record = replace(record, inputs=np.column_stack([POWER, inputs[:, 1]]))
    problem = make_problem(record, heated_tank(), ("efficiency", "loss"), burn_in=20, guard=5)
    fit = Fitter(problem).fit(heated_tank())
    assert fit is not None
    return problem, fit, Responses(problem, fit)


def heated(power: FloatArray, efficiency: float, loss: float, first: float) -> FloatArray:
    """The temperature (N,) of the tank by Euler's method with fine steps: no code of the package."""
    found = [first]
    for p in power[1:]:
        t = found[-1]
        for _ in range(200):
            t += DT / 200 * (efficiency * p - loss * (t - ROOM)) / CAPACITY
        found.append(t)
    return np.array(found)


def test_what_a_leak_does_is_hidden_where_the_heater_is_off(tank: tuple[Problem, Fit, Responses]) -> None:
    responses = tank[2]
    assert SHUT.mean() > 0.6
    assert responses.is_hidden("heating", np.where(SHUT, 1.0, 0.0))
    assert not responses.is_hidden("heating", np.where(SHUT, 0.0, 1.0))


def test_its_response_is_that_of_a_run_with_the_leak(tank: tuple[Problem, Fit, Responses]) -> None:
    problem, fit, responses = tank
    efficiency, loss = fit.values[:2]
    site = next(s for s in fit.model.sites if s.name == "heating")
    variants = list(bounded(site, "own_value", responses))
    assert len(variants) == 3
    for variant in variants:
        (profile,), ((_, level),) = variant.profiles, variant.start
        assert profile.response is not None and profile.values.max() == pytest.approx(level)
        with_leak, without = (
            heated(power, efficiency, loss, float(fit.initial_state[0]))
            for power in (np.maximum(POWER, level / efficiency), POWER)
        )
        expected = with_leak - without
        # a leak is rounded over a hundredth of the range
        np.testing.assert_allclose(profile.response[:, 0], expected, atol=0.02 * expected.max())
        shown = responses.of([profile, replace(profile, response=None)], problem.rows("estimate"))
        np.testing.assert_array_equal(shown[:, :, 0], profile.response[problem.rows("estimate")])
        assert np.abs(shown[:, :, 1]).max() < 0.5 * np.abs(shown[:, :, 0]).max()  # what a small change shows of it


def test_what_is_hidden_is_fitted_whatever_its_score() -> None:
    plain, hidden = TimeProfile("coil", np.ones(3), False), TimeProfile("valve", np.ones(3), True, np.ones((3, 1)))
    scores: Any = [
        SimpleNamespace(candidate=SimpleNamespace(name=(p.site, str(k))), variant=SimpleNamespace(profiles=(p,)))
        for k, p in enumerate([plain, plain, hidden, plain, hidden])
    ]
    assert with_hidden(scores[:1], scores) == [scores[0], scores[2], scores[4]]
    assert with_hidden(scores[:3], scores) == [*scores[:3], scores[4]]
