"""Where a fit starts and when it rests: never further from the record than what was given, never worse than before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.discovery.fitting.descent import START_FRACTIONS, Descent
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import SETTLED, Fitter
from adaptive_flot.discovery.fitting.unknowns import Unknowns
from adaptive_flot.discovery.record.problem import Problem, make_problem
from adaptive_flot.discovery.results import Alternative
from adaptive_flot.discovery.search.simplify import simpler
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.record import RecordSimulator
from adaptive_flot.processes import flotation
from tests.discovery.heated import DT, EXPONENT, NOISE, Truth, changed, heated_tank, tank_record

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
def test_a_start_is_shrunk_to_the_fraction_that_is_nearest(base: tuple[Problem, Fit], exponent: float) -> None:
    problem, fit = base
    model = fit.model.with_effects([DRAUGHT])

    def descent(value: float) -> Descent:
        unknowns = Unknowns(problem, model, (EXPONENT_NAME,), {EXPONENT_NAME: value}, fit, {})
        return Descent(problem, Fitter(problem).rows, model, unknowns)

    def distance(d: Descent) -> float:
        return d._objective(d.unknowns.centre, d._predict(d.unknowns.centre), d._first_noise())

    shrunk = descent(exponent)
    shrunk.shrink([EXPONENT_NAME])
    assert distance(shrunk) == pytest.approx(
        min(distance(descent(fraction * exponent)) for fraction in START_FRACTIONS)
    )


@pytest.mark.parametrize("start", [6.0, -6.0])
def test_a_start_that_is_far_too_large_still_comes_to_the_truth(base: tuple[Problem, Fit], start: float) -> None:
    problem, fit = base
    model = fit.model.with_effects([DRAUGHT])
    found = Fitter(problem).fit(model, (EXPONENT_NAME,), {EXPONENT_NAME: start}, fit, shrink=(EXPONENT_NAME,))
    assert found is not None
    assert dict(zip(found.names, found.values, strict=True))[EXPONENT_NAME] == pytest.approx(EXPONENT, abs=0.03)


def test_a_start_with_which_the_model_can_not_run_is_nothing_at_all(base: tuple[Problem, Fit]) -> None:
    """A loss that falls steeply with the temperature runs away: only without it there is a run to go on from."""
    problem, fit = base
    effect = Effect("heat_loss", "temperature", "proportional")
    slope = effect.parameter("slope")
    model = fit.model.with_effects([effect])
    assert Fitter(problem).fit(model, (slope,), {slope: -1e9}, fit) is None
    found = Fitter(problem).fit(model, (slope,), {slope: -1e9}, fit, shrink=(slope,))
    assert found is not None
    assert found.loss <= fit.loss + SETTLED  # a fit rests where a restart would gain no more


LATE = (
    Effect("heating", "lag", "lag", {"amplitude": 1.0, "time_constant": 90.0}, {"scale": 1000.0}),
    Effect("thermometer", "lag", "lag", {"amplitude": 1.0, "time_constant": 60.0}, {"scale": 300.0}),
)


@pytest.mark.parametrize("left", [(), (0,), (1,), (1, 0)])
def test_a_fit_starts_from_one_with_more_effects(base: tuple[Problem, Fit], left: tuple[int, ...]) -> None:
    """An effect that goes takes its states with it; those of the others keep their value, wherever they now stand."""
    problem, fit = base
    larger = fit.model.with_effects(LATE)
    values: FloatArray = np.arange(300.0, 300.0 + len(larger.states))
    like = replace(fit, model=larger, initial_state=values, directions=np.diag(values))
    smaller = fit.model.with_effects([LATE[k] for k in left])
    unknowns = Unknowns(problem, smaller, (), {}, like, {})
    of_larger = dict(zip(larger.names("states"), values, strict=True))
    expected = [of_larger[name] for name in smaller.names("states")]
    np.testing.assert_array_equal(unknowns.x0, expected)
    np.testing.assert_array_equal(unknowns.directions.sum(axis=1), expected)
    assert Fitter(problem).fit(smaller, like=like, rounds=1, steps=1) is not None


def test_a_slow_sensor_may_be_on_its_way_when_the_record_starts() -> None:
    """The thermometer starts 15 K below the tank and closes in by the exponential law, row by row."""
    record, tau = tank_record(Truth(exponent=0.0, noise=0.0)), 300.0
    shown, seen = float(record.outputs[0, 0]) - 15.0, []
    for temperature in record.outputs[:, 0]:
        shown += (1 - np.exp(-DT / tau)) * (temperature - shown)
        seen.append(shown)
    noisy = np.array(seen) + NOISE * np.random.default_rng(3).standard_normal(len(seen))
    problem = make_problem(changed(record, noisy), heated_tank(), ADAPTED, burn_in=2, guard=5)
    fit = Fitter(problem).fit(heated_tank())
    assert fit is not None
    slow = Effect("thermometer", "lag", "lag", {"amplitude": 1.0}, {"scale": 300.0})
    name = slow.parameter("time_constant")
    found = Fitter(problem).fit(fit.model.with_effects([slow]), (name,), {name: 100.0}, fit)
    assert found is not None
    assert dict(zip(found.names, found.values, strict=True))[name] == pytest.approx(tau, rel=0.06)
    assert found.noise.std[0] == pytest.approx(NOISE, rel=0.15)


def test_a_dependence_with_a_state_can_be_tried_as_a_constant() -> None:
    """What depends on the concentrate grade follows it through a state, which a constant does not have."""
    cell = flotation.make_model()
    adapted = tuple(p.name for p in cell.parameters if p.role == "estimated")
    held = np.array([[2.0e-3, 1.7e-4, 0.36], [1.5e-3, 1.7e-4, 0.36], [1.8e-3, 2.0e-4, 0.38]])
    inputs = np.repeat(held, 120, axis=0)
    x0 = steady_state(cell, inputs[0], cell.parameter_values).state
    blank = Dataset("cell", np.arange(1.0, 361.0), 1.0, inputs, np.zeros((360, len(cell.outputs))))
    clean = RecordSimulator(cell, 1.0).outputs(blank, x0, cell.parameter_values)
    noise = 1e-3 * np.ptp(clean, axis=0) * np.random.default_rng(0).standard_normal(clean.shape)
    problem = make_problem(replace(blank, outputs=clean + noise), cell, adapted, burn_in=10, guard=2)
    fitter = Fitter(problem)
    fit = fitter.fit(cell, rounds=1, steps=2)
    assert fit is not None
    effects = [
        Effect("floatability_valuable", "grade", "power", settings={"reference": 0.2}),
        Effect("gas_slip", "constant", "shift"),
    ]
    model = fit.model.with_effects(effects)
    assert len(model.states) == len(cell.states) + 1
    names = tuple(e.parameter(c.name) for e in effects for c in e.terms)
    both = fitter.fit(model, names, like=fit, rounds=1, steps=1)
    assert both is not None
    alternative = Alternative(tuple((e.site, e.driver) for e in effects), (True, True), both, 0.0, 0.0)
    (found,) = simpler(fitter, fit, alternative)
    assert found.names == (("floatability_valuable", "constant"), ("gas_slip", "constant"))
    assert len(found.fit.model.states) == len(cell.states) == len(found.fit.initial_state)


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


def test_a_fit_that_begins_with_its_own_noise_stays_where_it_is(base: tuple[Problem, Fit]) -> None:
    """By large white noise a limit came to rest elsewhere, with half of the noise more: an idle effect was told."""
    problem, fit = base
    fitter = Fitter(problem)
    settled = fitter.settled(fit)
    again = fitter.fit(settled.model, settled.names, like=settled, rounds=2, noise=settled.noise)
    assert again is not None
    assert again.loss <= settled.loss + SETTLED
    np.testing.assert_allclose(again.values, settled.values, rtol=1e-3)
