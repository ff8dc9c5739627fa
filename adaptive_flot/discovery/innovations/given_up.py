"""Which effects beside others are given up: they draw what is left of a wrong model, and are not there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from adaptive_flot.discovery.hypotheses.families import EVENTS, FOREVER, STRUCTURE, Hypothesis
from adaptive_flot.discovery.innovations.events.switching import chance_of_edges
from adaptive_flot.discovery.innovations.search.explanation import LEAST_GAIN, Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.greybox.data.dataset import Dataset

OWN = 0.8
"""Share of the gain that is lost without an event beside another effect, at least."""
BY_ITSELF = 0.5
"""Share of the gain that an event has alone, and beside the other effect, from which it stands by itself."""
FOR_A_TIME = 0.7
"""The same of an event that comes once and goes again."""
WANDERS = 0.25
"""Share of the gain of an event from which a further one at its site, at other times, says that the site wanders."""
BESIDE = 0.02
"""Share of a record at its ends in which a change is none."""
BY_CHANCE = 1e-3
"""Probability below which the times of an event are those of an input: then it is no event."""


def at_steps_of_an_input(search: Search, explanation: Explanation) -> tuple[Hypothesis, ...]:
    """Events beside another effect that begin and end where an input steps, more often than by chance.

    One alone may well come with an input: guests when those who are counted go.
    """
    beside = explanation.hypotheses if len(explanation.hypotheses) > 1 else ()
    return tuple(h for h in beside if h.kind in EVENTS and _follows_an_input(search, h))


def overlapping(
    search: Search, base: Explanation, best: Explanation, without: Mapping[str, Explanation]
) -> tuple[Hypothesis, ...]:
    """An event beside another effect that explains much of the same: it draws what is left of a wrong model.

    Nothing else draws an event that is there. So without it most of the gain is lost (OWN). Not so beside a constant
    error at its site: that and the event are the level before and after. Nor is it given up where it explains most of
    it (OWN) alone: it is the other effect, then, that draws what is left. Nor where it stands by itself, see
    `stands_by_itself`. Since a reference, what a plant has or has not does not come between two records: it is then
    enough that the event explains more alone than that.
    """
    if len(best.hypotheses) < 2:
        return ()
    most = OWN * (best.criterion - base.criterion)
    levels = {h.site for h in best.hypotheses if h.driver == "constant"}
    events = [h for h in best.hypotheses if h.kind in EVENTS and h.site not in levels]

    def is_needed(event: Hypothesis) -> bool:
        others = [h for h in best.hypotheses if h is not event]
        alone, rest = max(without[h.effect.label].criterion for h in others), without[event.effect.label].criterion
        structure = search.since_reference and all(h.kind in STRUCTURE for h in others)
        leads = structure and alone - rest >= LEAST_GAIN
        changes = changes_within(event, search.record)
        by_itself = stands_by_itself(changes, best.criterion, base.criterion, alone, rest)
        return leads or by_itself or best.criterion - rest >= most or alone - base.criterion >= most

    return tuple(h for h in events if not is_needed(h))


def changes_within(event: Hypothesis, record: Dataset) -> int:
    """How often an event begins or ends within a record: a change within a share BESIDE of it of its ends is none."""
    first, last = float(record.time[0]), float(record.time[-1])
    margin = BESIDE * (last - first)
    edges = [t for begin, long in event.pulses for t in (begin, begin + long)]
    return sum(first + margin < t < last - margin for t in edges)


def stands_by_itself(changes: int, both: float, neither: float, alone: float, without: float) -> bool:
    """Whether an event has most of the gain of two effects with and without the other one: BY_ITSELF, or FOR_A_TIME.

    Then the other one explains something else, and draws nothing of it. What a wrong model leaves comes and goes with
    the inputs: of an event that comes and goes once more is asked, and one that does so again and again never stands by
    itself.

    Parameters
    ----------
    changes
        How often the event begins or ends.
    both, neither, alone, without
        Criteria: of both effects, of neither, of the event alone, of the other one alone.
    """
    if changes not in (1, 2):
        return False
    least = (BY_ITSELF if changes == 1 else FOR_A_TIME) * (both - neither)
    return alone - neither >= least and both - without >= least


def wanders(search: Search, explanation: Explanation, event: Hypothesis, gain: float) -> bool:
    """Whether a further switch at the site of an event, which has gained so much, gains WANDERS of that."""
    return search.switched_again(explanation, event) >= WANDERS * gain


def why_given_up(search: Search, given_up: Sequence[Hypothesis]) -> str:
    """Why effects were given up."""
    events = [h for h in given_up if h.kind in EVENTS and _follows_an_input(search, h)]
    others = [h for h in given_up if h not in events]
    why = [f"{', '.join(h.label for h in events)}: at steps of an input, so it is no event"] if events else []
    if others:
        said = ", ".join(h.label for h in others)
        why.append(f"{said} predict{'s' if len(others) == 1 else ''} no rows that did not fit it")
    return "; ".join(why)


def _follows_an_input(search: Search, event: Hypothesis) -> bool:
    record, edges = search.record, list[float]()
    for begin, long in event.pulses:
        edges += [begin, begin + long] if long < FOREVER else [begin]
    rows = np.searchsorted(record.time, np.array(edges) - record.dt / 4)
    inside = rows[(rows > 0) & (rows < len(record))]
    return chance_of_edges(inside, record.inputs) < BY_CHANCE
