"""An event that one site explains is tried at every other one: a regression takes it for small, and may not see it.

The record is of a room with a fan, simulated here by Euler's rule. From a time on the fan moves half of its air.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.cross_validation import model_with
from adaptive_flot.discovery.hypotheses.families import constant_change
from adaptive_flot.discovery.innovations.search.beam import best_explanations, events_alone
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.greybox import Dataset
from benchmarks.other_processes.plants.room_air import DT, make_model
from tests.discovery.innovations.box import model as box_model

ROWS, BEGINS, LEFT, FINE = 700, 520, 0.45, 10
FAN_AIR, LEAKS, BREATH, VOLUME = 380.0, 55.0, 0.019, 180.0
"""Of fan and leaks [m3/h], of one person [m3/h], and of the room [m3]."""
NOISE = 6.0
"""Standard deviation of the sensor [ppm]."""


def record(left: float, seed: int = 2) -> Dataset:
    """Carbon dioxide in the room; the fan moves a share `left` of its air from row BEGINS on, and the wind wanders."""
    rng = np.random.default_rng(seed)
    inputs = np.zeros((ROWS, 2))
    for column, choices in ((0, (0.1, 0.3, 0.6, 1.0)), (1, np.arange(9.0))):
        k = 0
        while k < ROWS:
            held = int(rng.integers(20, 80))
            inputs[k : k + held, column] = rng.choice(choices)
            k += held
    level, wind, shown, h = 600.0, 0.0, np.zeros(ROWS), DT / FINE
    for k in range(ROWS):
        fan, people = inputs[k]
        wind += -wind * DT / 5000.0 + 0.1 * np.sqrt(2 * DT / 5000.0) * rng.normal()
        air = FAN_AIR * fan * (left if k >= BEGINS else 1.0) + LEAKS * (1 + wind)
        for _ in range(FINE if k else 0):
            level += h * (1e6 * BREATH * people - air * (level - 420.0)) / (3600.0 * VOLUME)
        shown[k] = level + NOISE * rng.normal()
    return Dataset("room", DT * np.arange(ROWS, dtype=float), DT, inputs, shown[:, None])


def search(left: float) -> Search:
    model = make_model()
    free = tuple(p.name for p in model.parameters)
    return Search(model, record(left), (0,), np.array([NOISE]), free)


@pytest.fixture(scope="module")
def halved() -> Search:
    return search(LEFT)


def test_a_force_may_change_by_a_factor_and_a_flow_by_an_amount() -> None:
    """A spring that is half as stiff; uncounted guests, where no site of the model is for amounts; and a sensor."""
    room, box = search(LEFT), box_model()
    with np.errstate(all="ignore"):
        screening = room.screening(room.base(room.model.parameter_values), [])
    modes = {s.name: screening._modes_of_switch(s) for s in room.model.sites}
    flows = [s.name for s in room.model.sites if s.role in ("flow", "process") and s.mode == "factor"]
    assert flows and all(modes[name] == ("factor", "offset") for name in flows)
    force = next(s for s in box.sites if s.name == "other_heat")
    assert screening._modes_of_switch(force) == ("offset", "factor")
    sensor = next(s for s in room.model.sites if s.role == "sensor")
    assert modes[sensor.name] == (sensor.mode,)


def test_the_times_of_a_site_tried_there_give_what_the_site_found_itself(halved: Search) -> None:
    base = halved.base(halved.model.parameter_values)
    sites = [s for s in halved.model.sites if s.role != "sensor"]  # a sensor's events are half a row later
    screening = halved.screening(base, [s.name for s in sites])
    found = {site.name: one for site in sites if (one := screening.switch(site)) is not None}
    assert found
    for site in sites:
        if site.name in found:
            own = found[site.name]
            elsewhere = next(s.name for s in sites if s != site)
            tried = screening.at_times_of(replace(own.suspect.hypothesis, site=elsewhere), site)
            mode = own.suspect.hypothesis.effect.mode
            (again,) = (s for s in tried if s.suspect.hypothesis.effect.mode == mode)
            assert again.gain == pytest.approx(own.gain, rel=1e-9)
            np.testing.assert_allclose(again.size, own.size, rtol=1e-9)
            assert all(
                s.suspect.hypothesis.effect.mode != mode for s in screening.at_times_of(own.suspect.hypothesis, site)
            )


def test_what_enters_a_balance_is_tried_by_an_amount_as_well(halved: Search) -> None:
    """No site of this model is for amounts: people who are not counted are an amount, whoever is counted."""
    base = halved.base(halved.model.parameter_values)
    screening = halved.screening(base, [s.name for s in halved.model.sites])
    (breath,) = (s for s in halved.model.sites if s.name == "breath")
    own = screening.switch(breath)
    assert own is not None
    of_the_fan = replace(own.suspect.hypothesis, site="fan")
    modes = {s.suspect.hypothesis.effect.mode for s in screening.at_times_of(of_the_fan, breath)}
    assert modes == {"factor", "offset"}


def test_the_site_of_a_large_event_explains_more_than_one_that_the_regression_prefers(halved: Search) -> None:
    base = halved.base(halved.model.parameter_values)
    best = best_explanations(halved, base)[0]
    (event,) = (h for h in best.hypotheses if h.kind == "switch")
    assert event.site == "fan"
    assert event.effect.coefficients["on_1"] == pytest.approx(DT * BEGINS, abs=20 * DT)
    fitted = halved.model_of(best)
    p = fitted.parameters[fitted.index("parameters", event.effect.parameter("amplitude"))]
    assert np.exp(p.value) == pytest.approx(LEFT, abs=0.1)


def test_an_event_that_was_found_beside_something_of_no_size_is_fitted_alone(halved: Search) -> None:
    """With the times that it has there; nothing else is fitted anew."""
    best = best_explanations(halved, halved.base(halved.model.parameter_values))[0]
    (event,) = best.hypotheses
    breath = next(s for s in halved.model.sites if s.name == "breath")
    idle = constant_change(breath, 1.0)
    p = model_with(halved.model_of(best), idle).parameter_values
    pair = halved.added(best, idle, p)
    (alone,) = events_alone(halved, [pair, best])
    assert alone.hypotheses == (event,)
    assert alone.criterion == pytest.approx(best.criterion, abs=0.5)
    assert events_alone(halved, [halved.without(pair, event)]) == []


def test_where_nothing_happens_there_is_no_event_at_any_site() -> None:
    quiet = search(1.0)
    best = best_explanations(quiet, quiet.base(quiet.model.parameter_values))[0]
    assert all(h.kind != "switch" for h in best.hypotheses)
