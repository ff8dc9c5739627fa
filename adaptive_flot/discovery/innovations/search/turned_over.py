"""Events that are there from the first row on: as well none, and one at all other times.

The constants take up which of both levels is the usual one, so that a regression beside them finds either. Where a
reference knows the constants, the record may tell. Else what is there for longer is the usual level, and of two that
are there for as long, the first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from adaptive_flot.discovery.hypotheses.cross_validation import model_with
from adaptive_flot.discovery.hypotheses.families import FOREVER, Hypothesis
from adaptive_flot.discovery.innovations.events.at_times import switch_at
from adaptive_flot.discovery.innovations.search.explanation import LEAST_GAIN, Explanation
from adaptive_flot.discovery.innovations.search.pauses import SHORT
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.parallel import parallel_map

ABOUT_HALF = 0.4
"""Share of a record from which an event that is there at first may be the usual state. A shorter one must explain
surely less than what begins after it."""
ASKED = 12
"""The best explanations whose events are turned over."""


def with_events_turned_over(search: Search, found: Sequence[Explanation]) -> list[Explanation]:
    """Explanations; of the first ones, the best, events from the first row on are at all other times, if better."""
    return [*parallel_map(lambda e: turned_over(search, e), found[:ASKED], search.processes), *found[ASKED:]]


def turned_over(search: Search, explanation: Explanation) -> Explanation:
    """The explanation, its event at all other times, or at the last of them, where that is better.

    Or about as good, and the event is there for about half of the record or more.
    """
    event = next((h for h in explanation.hypotheses if h.kind == "switch" and _is_there_at_first(search, h)), None)
    others = other_times(event.pulses) if event is not None else []
    if event is None or not others or search.time_is_up:
        return explanation
    site = next(s for s in search.model.sites if s.name == event.site)
    rest = search.without(explanation, event)
    values = {q.name: q.value for q in search.model_of(explanation).parameters}
    size = values[event.effect.parameter("amplitude")]
    dt, mode = search.record.dt, event.effect.mode or site.mode
    whole, last = (
        max(_with_times(search, rest, event, switch_at(site, mode, times, dt), size), key=lambda e: e.criterion)
        for times in (others, others[-1:])
    )
    # a pause of the event is no event of its own where it gains little
    turned = last if last.criterion > whole.criterion - LEAST_GAIN else whole
    begins = search.record.time[0]
    there = sum(min(a + long, search.record.time[-1]) - a for a, long in event.pulses)
    is_usual = there >= ABOUT_HALF * (search.record.time[-1] - begins)
    least = explanation.criterion + (-LEAST_GAIN if is_usual else LEAST_GAIN)
    return turned if turned.criterion > least else explanation


def other_times(pulses: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The pauses of an event that is there at first, with what comes after it: begins and durations [s]."""
    ends = [a + long for a, long in pulses]
    pauses = [(end, begin - end) for end, (begin, _) in zip(ends[:-1], pulses[1:], strict=True)]
    return pauses if pulses[-1][1] >= FOREVER else [*pauses, (ends[-1], FOREVER)]


def _is_there_at_first(search: Search, event: Hypothesis) -> bool:
    """Whether it begins with the record, but for a time that is short beside it."""
    begin, long = event.pulses[0]
    return bool(begin - search.record.time[0] <= SHORT * long)


def _with_times(
    search: Search, rest: Explanation, event: Hypothesis, again: Hypothesis, size: float
) -> list[Explanation]:
    """The rest with the event at other times, fitted from as large a change the other way.

    From the constants as they are without it, which make up for half of it, and as the model has them.
    """
    again = replace(again, limits=event.limits, scales=event.scales)
    extended = model_with(search.model_of(rest), again)
    p = extended.parameter_values
    p[extended.index("parameters", again.effect.parameter("amplitude"))] = -size
    as_given = p.copy()
    as_given[list(extended.indices("parameters", search.free))] = search.model.parameter_values[
        list(search.model.indices("parameters", search.free))
    ]
    return [search.added(rest, again, start) for start in (p, as_given)]
