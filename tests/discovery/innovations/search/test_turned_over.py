"""An event that is there from the first row on is as well none, and one at all other times."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.discovery.hypotheses.cross_validation import model_with
from adaptive_flot.discovery.hypotheses.families import FOREVER
from adaptive_flot.discovery.innovations.events.at_times import switch_at
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.search.turned_over import other_times, turned_over
from tests.discovery.innovations.box import DT, model, record

OPENS = 1800.0


@settings(max_examples=50, deadline=None)
@given(lengths=st.lists(st.integers(1, 9), min_size=1, max_size=7))
def test_the_event_or_the_other_is_there_at_any_time(lengths: list[int]) -> None:
    edges = np.concatenate([[0], np.cumsum(lengths)])
    pulses = [
        (float(edges[k]), float(edges[k + 1] - edges[k]) if k + 1 < len(edges) else FOREVER)
        for k in range(0, len(edges), 2)
    ]
    for t in np.arange(0.5, edges[-1] + 5):
        there = sum(a <= t < a + long for spells in (pulses, other_times(pulses)) for a, long in spells)
        assert there == 1


@pytest.mark.parametrize("begin", [0.0, 4 * DT])
def test_a_lid_that_opens_is_not_told_as_one_that_was_shut(begin: float) -> None:
    """The constants make up for either, and what begins takes one time less."""
    data, plain = record(lids=((OPENS, 1e9),)), model()
    search = Search(plain, data, (0,), np.array([0.03]), ("conductance", "exchange", "capacity", "wall_capacity"))
    loss = next(s for s in plain.sites if s.name == "loss")
    with np.errstate(all="ignore"):
        base = search.base(plain.parameter_values)
        shut = switch_at(loss, "factor", [(begin, OPENS - begin)], DT)
        p = model_with(search.model_of(base), shut).parameter_values
        told = search.added(base, shut, p)
        turned = turned_over(search, told)
    (event,) = turned.hypotheses
    assert event.pulses == ((OPENS, FOREVER),)
    assert turned.criterion > told.criterion - 12
    size = search.model_of(turned).parameters[-1 - len(event.effect.coefficients) + 1 :]
    by_name = {q.name: q.value for q in size}
    assert by_name["loss_by_time.amplitude"] == pytest.approx(np.log(4.0), abs=0.3)


def test_a_short_event_at_first_stays_one() -> None:
    """A lid that is shut after a tenth of the record: what is there for longer is the usual state."""
    shuts = 390.0
    data, plain = record(lids=((0.0, shuts),)), model()
    search = Search(plain, data, (0,), np.array([0.03]), ("conductance", "exchange", "capacity", "wall_capacity"))
    loss = next(s for s in plain.sites if s.name == "loss")
    with np.errstate(all="ignore"):
        base = search.base(plain.parameter_values)
        opened = switch_at(loss, "factor", [(0.0, shuts)], DT)
        told = search.added(base, opened, model_with(search.model_of(base), opened).parameter_values)
        (event,) = turned_over(search, told).hypotheses
    assert event.pulses == ((0.0, shuts),)


def test_an_event_that_begins_later_stays_as_it_is() -> None:
    data, plain = record(lids=((OPENS, 1e9),)), model()
    search = Search(plain, data, (0,), np.array([0.03]), ("conductance",))
    loss = next(s for s in plain.sites if s.name == "loss")
    with np.errstate(all="ignore"):
        base = search.base(plain.parameter_values)
        opens = switch_at(loss, "factor", [(OPENS, FOREVER)], DT)
        told = search.added(base, opens, model_with(search.model_of(base), opens).parameter_values)
        assert turned_over(search, told) is told
