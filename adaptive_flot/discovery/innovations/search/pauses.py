"""Short pauses and spells of an event that lasts: chance may part or end it, and an outlier may be told with it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.hypotheses.cross_validation import model_with
from adaptive_flot.discovery.hypotheses.families import FOREVER, Hypothesis
from adaptive_flot.discovery.innovations.events.at_times import times_of_switch
from adaptive_flot.discovery.innovations.search.explanation import LEAST_GAIN, Explanation, worth
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.parallel import parallel_map

SHORT = 0.15
"""Share of the shorter spell beside it below which a pause of an event is short. Of eight right events of several
spells the shortest pause was a third; of five that stood in for a lasting change 3 to 26 %."""
MOSTLY = 2 / 3
"""Share of the time from its first beginning to its last end from which an event with a short pause is hardly off."""
BLIP = 2.5
"""Rows up to which a spell beside one that lasts is a blip: as long as an outlier, and the row that forgets it."""
ASKED = 12
"""The best explanations whose short pauses are tried to be closed."""


def has_short_pause(h: Hypothesis) -> bool:
    """Whether an event stops for much less long (SHORT) than it is there before and after."""
    pairs = itertools.pairwise(h.pulses if h.kind == "switch" else ())
    return any(b - (a + long) < SHORT * min(long, after) for (a, long), (b, after) in pairs)


def is_hardly_off(h: Hypothesis) -> bool:
    """Whether an event has a short pause, and is there for most (MOSTLY) of the time from its beginning to its end.

    Beside long pauses a short one only says that the event is not as large all the time: someone leans on a slide three
    times, and hardly for a moment.
    """
    if not has_short_pause(h):
        return False
    begin, (last, long) = h.pulses[0][0], h.pulses[-1]
    return sum(spell for _, spell in h.pulses) > MOSTLY * (last + long - begin)


def has_blip(h: Hypothesis, dt: float) -> bool:
    """Whether an event is there for some BLIP rows of `dt` [s] only, and much longer (SHORT) at another time."""
    spells = [long for _, long in h.pulses] if h.kind == "switch" else []
    return bool(spells) and min(spells) <= min(BLIP * dt, SHORT * max(spells))


def ends_with_the_record(h: Hypothesis, end: float) -> bool:
    """Whether an event is over before a record is, which ends at `end` [s], and by much less (SHORT) than it lasts."""
    begin, long = h.pulses[-1] if h.kind == "switch" else (end, FOREVER)
    return long < FOREVER and end - (begin + long) < SHORT * long


def with_pauses_closed(search: Search, found: Sequence[Explanation]) -> list[Explanation]:
    """Explanations, the best first; what is short of the best ones' events is left out where it gains little."""
    closed = parallel_map(lambda e: without_short_pauses(search, e), found[:ASKED], search.processes)
    return sorted([*closed, *found[ASKED:]], key=lambda e: -worth(e))


def without_short_pauses(search: Search, explanation: Explanation) -> Explanation:
    """The explanation, its event without what is short and gains less than LEAST_GAIN beside its numbers.

    That is a pause, a blip, or an end before that of the record. An outlier of a gauge was told as a leak of two rows,
    before the one that stayed. A brine was weaker from some time on, and told so up to four rows before the end.
    """
    dt, end = search.record.dt, float(search.record.time[-1])

    def has_short_part(h: Hypothesis) -> bool:
        return has_short_pause(h) or has_blip(h, dt) or ends_with_the_record(h, end)

    parted = next((h for h in explanation.hypotheses if has_short_part(h)), None)
    if parted is None or search.time_is_up:
        return explanation
    whole, rest = _whole(parted, dt, end), search.without(explanation, parted)
    model, extended = search.model_of(explanation), model_with(search.model_of(rest), whole)
    held = {whole.effect.parameter(c) for c in whole.effect.coefficients} - set(whole.parameters)  # its times
    known = {q.name: q.value for q in model.parameters if q.name not in held}
    p = np.array([known.get(q.name, q.value) for q in extended.parameters])
    again = search.added(rest, whole, p)
    return again if again.criterion > explanation.criterion - LEAST_GAIN else explanation


def _whole(parted: Hypothesis, dt: float, end: float) -> Hypothesis:
    """The event without its blips, with its short pauses closed, and up to the end of the record if nearly so."""
    longest = max(long for _, long in parted.pulses)
    lasting = [(begin, long) for begin, long in parted.pulses if long > min(BLIP * dt, SHORT * longest)]
    spells = [list(lasting[0])]
    for begin, long in lasting[1:]:
        last = spells[-1]
        if begin - sum(last) < SHORT * min(last[1], long):
            last[1] = begin + long - last[0]
        else:
            spells.append([begin, long])
    if ends_with_the_record(parted, end) and spells[-1][0] + spells[-1][1] == sum(parted.pulses[-1]):
        spells[-1][1] = FOREVER
    told = times_of_switch([(begin, min(long, FOREVER)) for begin, long in spells])
    settings = {**parted.effect.settings, "count": float(len(spells))}
    return replace(parted, effect=replace(parted.effect, coefficients=told, settings=settings))
