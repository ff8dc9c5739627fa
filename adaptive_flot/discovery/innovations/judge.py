"""Which effects of the best explanation are certain, and whether they predict rows that did not fit them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.hypotheses.families import EVENTS, Hypothesis
from adaptive_flot.discovery.hypotheses.plausible import rests_at_edge
from adaptive_flot.discovery.innovations.filter.refit import Refitter
from adaptive_flot.discovery.innovations.given_up import at_steps_of_an_input, overlapping, why_given_up
from adaptive_flot.discovery.innovations.late import late_anywhere, late_somewhere
from adaptive_flot.discovery.innovations.search.explanation import LEAST_GAIN, Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.telling_apart import low_end, told_apart
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.results.words import LARGEST_CLASS
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.parallel import parallel_map

SMALL = 0.15
"""An effect beside another one, that brings less than this share of the gain, is not told."""
TOO_LARGE = "what fits best would have to be larger than such a fault can be"
FOLDS = 5


def judge(search: Search, base: Explanation, found: Sequence[Explanation]) -> Told:
    """Judge the explanations, the best first.

    What is certain must be in every explanation about as good, and must predict stretches of rows that did not fit its
    coefficients better than the rest of the explanation does without it. An event beside another effect is none at the
    times of an input's steps, or where the other effect explains much of the same: it takes up what else is wrong with
    the model there. Where the rest is one of a few, it is a class.
    """
    possible = [e for e in found if not _beyond(search, e)]
    matters = found[0].criterion - base.criterion >= LEAST_GAIN
    if matters and found[0] not in possible and (not possible or told_apart(search, base, found[0], possible[0])):
        alone = _event_alone(search, base, found)
        return alone or Told("abstain", found[0], (), (), (found[0],), TOO_LARGE)
    found = possible or found
    given_up, everything = list[Hypothesis](), found
    while found[0].criterion - base.criterion >= LEAST_GAIN:
        best = found[0]
        without = _without_each(search, best) if len(best.hypotheses) > 1 else {best.hypotheses[0].effect.label: base}
        failed = at_steps_of_an_input(search, best) or overlapping(search, base, best, without)
        failed = failed or _contradicted(search, best, without)
        if not failed:
            told = _told(search, base, found, without)
            if told.word != "abstain" and _beyond(search, told.best):  # beside what is left out it was not
                return replace(told, word="abstain", certain=(), open=(), why=TOO_LARGE)
            return _unless_given_up(search, base, told, given_up, everything)
        given_up.append(failed[0])
        if len(best.hypotheses) == 1:
            break
        # the one that does least is given up, and the rest judged anew
        found = [e for e in found if all(_name(h) != _name(failed[0]) for h in e.hypotheses)]
    if not given_up:
        return Told("none", base, (), (), (base,), "constants and process noise explain it")
    why = why_given_up(search, given_up)
    if found[0].criterion - base.criterion < LEAST_GAIN:  # nothing is left beside what was given up
        return Told("abstain", base, (), (), (base,), why)
    return Told("abstain", found[0], (), (), _alike(search, base, found), why)


def _event_alone(search: Search, base: Explanation, found: Sequence[Explanation]) -> Told | None:
    """The event of the best explanation, whose other effect would have to be too large; None where it is not certain.

    Something else is wrong with the model then, and that effect takes it up. The event is certain where every
    explanation without it is told from the best one, and from it every other effect alone; and where it predicts
    stretches that did not fit it.
    """
    events = [h for h in found[0].hypotheses if h.kind in EVENTS and not _rests_at_edge(search, found[0], h)]
    if len(found[0].hypotheses) != 2 or len(events) != 1:
        return None
    without = [e for e in found if not _has(e, events[0])]
    singles = [e for e in found if len(e.hypotheses) == 1]
    own = next((e for e in singles if _has(e, events[0])), None)
    if own is None or own.criterion - base.criterion < LEAST_GAIN or _beyond(search, own):
        return None
    rivals = [e for e in without if e in singles]
    sure = all(told_apart(search, base, found[0], e) for e in without)
    if not sure or not all(told_apart(search, base, own, e) for e in rivals):
        return None
    if _contradicted(search, own, {own.hypotheses[0].effect.label: base}):
        return None
    return Told("named", own, own.hypotheses, (), (own,), "")


def _without_each(search: Search, explanation: Explanation) -> dict[str, Explanation]:
    """An explanation of several effects without each of them, by the effect's name: a part may be late in two ways."""
    effects = explanation.hypotheses
    left = parallel_map(lambda k: search.without(explanation, effects[k]), range(len(effects)), search.processes)
    return {h.effect.label: e for h, e in zip(effects, left, strict=True)}


def _unless_given_up(
    search: Search, base: Explanation, told: Told, given_up: Sequence[Hypothesis], found: Sequence[Explanation]
) -> Told:
    """What is told, unless the record tells it from something better that has been given up.

    What is given up beside another effect leaves that one. Where an effect is told that none of the explanations had
    that came first, it stands in for them. So does an event, where another one, given up, explains more alone: a leak
    that opens was given up beside a dependence that takes a part of it, and an event elsewhere named for both.
    """
    if told.word == "abstain" or not given_up:
        return told
    first = _alike(search, base, found)
    if not all(any(_has(e, h) for e in first) for h in told.effects) and told_apart(search, base, first[0], told.best):
        why = f"{' with '.join(h.label for h in first[0].hypotheses)} explains more, and is not certain"
        return replace(told, word="abstain", certain=(), open=(), why=why)
    events = {_name(h) for h in given_up if h.kind in EVENTS}
    alone = [e for e in found if len(e.hypotheses) == 1 and _name(e.hypotheses[0]) in events]
    better = max(alone, key=lambda e: e.criterion, default=told.best)
    is_event = bool(told.effects) and all(h.kind in EVENTS for h in told.effects)
    if not is_event or better.criterion < told.best.criterion + LEAST_GAIN:
        return told
    why = f"{better.hypotheses[0].label} explains more, and is not certain"
    return replace(told, word="abstain", certain=(), open=(), why=why)


def _beyond(search: Search, explanation: Explanation) -> bool:
    """Whether one of its effects rests at the end of what such a fault can be."""
    return any(_rests_at_edge(search, explanation, h) for h in explanation.hypotheses)


def _rests_at_edge(search: Search, explanation: Explanation, h: Hypothesis) -> bool:
    if not h.limits:
        return False
    value = {q.name: q.value for q in search.model_of(explanation).parameters}
    return rests_at_edge(h, value.__getitem__)


def _told(
    search: Search, base: Explanation, found: Sequence[Explanation], without: Mapping[str, Explanation]
) -> Told:  # fmt: skip
    """What is said of the best explanation, whose effects all predict rows that did not fit them."""
    best, alike = found[0], _alike(search, base, found)
    certain = tuple(h for h in best.hypotheses if all(_has(e, h) for e in alike))
    rest = [(e, h) for e in alike for h in e.hypotheses if not any(_same(h, c) for c in certain)]
    events = [(e, h) for e, h in rest if h.kind in EVENTS]
    if {id(e) for e, _ in events} == {id(e) for e in alike}:  # whatever else there is, something is switched
        members = _one_a_site(events)
        if 2 <= len(members) <= LARGEST_CLASS:
            return _certain_alone(search, base, Told("class", best, certain, members, alike, ""), without)
    members = _one_a_site(rest)
    if len(certain) == len(best.hypotheses):
        named = _without_small_ones(base, Told("named", best, certain, (), alike, ""), without)
        return late_anywhere(search, base, named)
    # "one of these" is true where each explanation has one effect beside what is certain, and not where it has two
    one_open = all(len(e.hypotheses) == len(certain) + 1 for e in alike)
    if 2 <= len(members) <= LARGEST_CLASS and one_open:
        return _certain_alone(search, base, Told("class", best, certain, members, alike, ""), without)
    if not certain:
        late = late_somewhere(search, base, alike)
        if late is not None and not _contradicted(search, late.best, {late.best.hypotheses[0].effect.label: base}):
            return late
        why = f"{len(alike)} explanations are about as good, and have no effect in common"
        return Told("abstain", best, (), (), alike, why)
    open_one = next(h for h in best.hypotheses if h not in certain)
    return Told("named", without[open_one.effect.label], certain, (), alike, "")


def _without_small_ones(base: Explanation, told: Told, without: Mapping[str, Explanation]) -> Told:
    """A name without an effect that does little beside the other one: it takes up what else is wrong with the model."""
    total = told.best.criterion - base.criterion
    small = min(told.certain, key=lambda h: told.best.criterion - without[h.effect.label].criterion)
    rest = without[small.effect.label]
    if len(told.certain) == 1 or told.best.criterion - rest.criterion >= SMALL * total:
        return told
    return replace(told, best=rest, certain=tuple(h for h in told.certain if h is not small))


def _certain_alone(search: Search, base: Explanation, told: Told, without: Mapping[str, Explanation]) -> Told:
    """What is certain by name, where what is open beside it does little: it takes up what else is wrong."""
    best = told.best
    open_ones = [h for h in best.hypotheses if not any(h is c for c in told.certain)]
    if not told.certain or len(open_ones) != 1:
        return told
    rest = without[open_ones[0].effect.label]
    if best.criterion - rest.criterion >= SMALL * (best.criterion - base.criterion):
        return told
    return late_anywhere(search, base, replace(told, word="named", best=rest, open=()))


def _alike(search: Search, base: Explanation, found: Sequence[Explanation]) -> tuple[Explanation, ...]:
    """The best explanation, and those that the record does not tell from it.

    Not those that have all effects of another of these and one more: "one of these" is as true without them.
    """
    near = (found[0], *(e for e in found[1:] if not told_apart(search, base, found[0], e)))
    return (near[0], *(e for e in near[1:] if not any(_only_adds(e, other) for other in near)))


def _only_adds(explanation: Explanation, other: Explanation) -> bool:
    """Whether an explanation has the effects of another one, which has some, and more; a lag is one at any place.

    Lags in a row commute (see `late_where`): its place is asked once more, alone.
    """
    one, two = (
        Counter(("", h.driver, h.kind) if h.kind == "lag" else _name(h) for h in e.hypotheses)
        for e in (explanation, other)
    )
    return bool(two) and two < one


def _one_a_site(pairs: Sequence[tuple[Explanation, Hypothesis]]) -> tuple[tuple[Explanation, Hypothesis], ...]:
    """One effect a site; where all are at one site, an event and a lasting one: its place is certain then."""
    by_site: dict[str, tuple[Explanation, Hypothesis]] = {}
    by_kind: dict[bool, tuple[Explanation, Hypothesis]] = {}
    for e, h in pairs:
        by_site.setdefault(h.site, (e, h))
        by_kind.setdefault(h.driver == "time", (e, h))
    return tuple((by_site if len(by_site) > 1 else by_kind).values())


def _name(h: Hypothesis) -> tuple[str, str, str]:
    return h.site, h.driver, h.kind


def _has(explanation: Explanation, h: Hypothesis) -> bool:
    """Whether an explanation has an effect at the same site: an event where it is one, a lasting one else."""
    return any(_same(k, h) for k in explanation.hypotheses)


def _same(a: Hypothesis, b: Hypothesis) -> bool:
    return a.site == b.site and (a.driver == "time") == (b.driver == "time")


def _contradicted(
    search: Search, explanation: Explanation, without: Mapping[str, Explanation]
) -> tuple[Hypothesis, ...]:
    """Effects without which the other ones predict fresh rows as well, the one that gains least first."""
    fresh = _fresh_rows(search, explanation)
    failed: list[tuple[float, Hypothesis]] = []
    for h in explanation.hypotheses:
        rest = without[h.effect.label]
        extra = explanation.numbers - rest.numbers - len(h.free)
        if low_end(fresh - _fresh_rows(search, rest), extra) <= 0:
            failed.append((explanation.criterion - rest.criterion, h))
    return tuple(h for _, h in sorted(failed, key=lambda f: f[0]))


def _fresh_rows(search: Search, explanation: Explanation) -> FloatArray:
    """Log-likelihood of each row (N,) by coefficients that were fitted to the other stretches.

    Constants and noise stay as all rows have them: every explanation has the same freedom there. What is asked is
    whether coefficients found on some rows hold on others.
    """
    if not explanation.free:
        return explanation.fit.rows
    n, model = len(search.record), search.model_of(explanation)
    edges = np.linspace(0, n, FOLDS + 1).round().astype(int)

    def one(k: int) -> FloatArray:
        counted = np.ones(n, dtype=bool)
        counted[edges[k] : edges[k + 1]] = False
        fitter = Refitter(model, search.record, search.columns, search.floor, explanation.free, None, counted)
        fit = fitter.fit(explanation.fit.p, explanation.fit.size, hold_noise=True)
        return fit.rows[edges[k] : edges[k + 1]]

    return np.concatenate(parallel_map(one, range(FOLDS), search.processes))
