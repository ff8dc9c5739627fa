"""What the free run has, which a name of the innovations form must beat, and where it leaves too much."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.assessment.verification import AT_NOISE, MUCH_WORSE
from adaptive_flot.discovery.hypotheses.comparison import EXPLAINED
from adaptive_flot.discovery.hypotheses.families import EVENTS, FOREVER, Hypothesis
from adaptive_flot.discovery.hypotheses.telling import FAR_ABOVE
from adaptive_flot.discovery.innovations.given_up import WANDERS, changes_within, stands_by_itself, wanders
from adaptive_flot.discovery.innovations.search.explanation import LEAST_GAIN, Explanation
from adaptive_flot.discovery.innovations.search.pauses import is_hardly_off
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.search.walking import comes_again, gain_of_a_walk, told_once
from adaptive_flot.discovery.innovations.telling_apart import NEAR
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.record.robust import clipped_std, noise_by_differences
from adaptive_flot.discovery.results import OutputChange, State
from adaptive_flot.discovery.results.words import TELLING, WITH_A_NAME
from adaptive_flot.discovery.verdict.judge import may_drift
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.forms.form import CoefficientRole
from adaptive_flot.greybox.model import FloatArray

FAR = 3.0
"""An error so many times the noise from row to row is not explained by measurement noise."""
MUCH = 100.0
"""Fall of the Bayesian information criterion by which an alternative explains much; half of it where the model errs."""
ERRS = 1.5
"""Times the noise from row to row from which the model as it is surely errs."""
ONCE = 1 / (1 + WANDERS)
"""Share of the gain of an event that comes again and again which a single spell has: further ones have less than
WANDERS of that."""
TREND = 100.0
"""Gain of log-likelihood below which a change that lasts to the end of a record may be slow wandering."""


def leaves_too_much(state: State, far: float = FAR) -> bool:
    """Whether an error is more than `far` times the noise: of all rows, or of the report rows, which fitted nothing.

    Each row counts up to three standard deviations: outliers are no model error.
    """
    problem, (_, after) = state.known_problem, state.refitted
    residual, noise = after.residual(problem), noise_by_differences(problem.measured)
    splits = (problem.rows(), problem.rows("report"))
    left = [np.where(rows[:, None], residual, np.nan).T for rows in splits if rows.any()]
    return any(clipped_std(e) > far * s for part in left for e, s in zip(part, noise, strict=True) if s > 0)


def follows_time(state: State) -> bool:
    """Whether what is told holds a free curve in time: it follows anything between rows that it has seen."""
    best = state.judged.best if state.judged.word in WITH_A_NAME else None
    return best is not None and any(_free_course(e) for e in best.effects)


def one_of_them_drifts(state: State) -> bool:
    """Whether the best of a class is a change in time of what is fitted, and the model does not say that it drifts.

    Row by row it may be told apart.
    """
    best = state.judged.best if state.judged.word == "class" else None
    if best is None or may_drift(state.refitted[0].model, state.known_problem.adapted):
        return False
    return all(site in state.searched[1].adapted_sites and driver == "time" for site, driver in best.names)


def unconfirmed(state: State) -> bool:
    """Whether a `none` rests on a search whose best alternative explains much (see MUCH), and was not confirmed.

    Then something is there, and the alternative is not it.
    """
    if state.judged.word != "none" or state.judged.best is not None:
        return False
    _, result = state.searched
    most = min((a.delta_bic for a in result.alternatives), default=0.0)
    return most <= -MUCH or (most <= -MUCH / 2 and leaves_too_much(state, ERRS))


def surely_better(state: State) -> bool:
    """Whether a change in time of what is fitted, on which a `none` may rest, surely helps on the report rows."""
    return state.judged.best is not None and any(c.reduction95[0] > 0 for c in state.error)


def competes(state: State) -> bool:
    """Whether the free run has something that must leave the larger error: what it tells, or its best alternative.

    A free curve in time that is not told is no rival, and neither is what the report rows have taken back.
    """
    judged = state.judged
    if judged.word in TELLING:
        return True
    untold = judged.best is not None and judged.word == "abstain" and not state.contradiction
    return untold and judged.best is not None and not any(_free_course(e) for e in judged.best.effects)


def but_for_what_wanders(state: State, names: tuple[tuple[str, str], ...]) -> bool:
    """Whether the free run has the same effects, and free curves in time beside them, which follow what wanders."""
    best = state.judged.best
    if best is None or not set(names) < set(best.names):
        return False
    return all(_free_course(e) for e in best.effects if (e.site, e.driver) not in names)


def allowed_ratio(state: State, names: tuple[tuple[str, str], ...]) -> float:
    """Ratio of errors up to which what is told is as good.

    Above 1 beside what has more coefficients, and says less: a curve without a name at the place of a fault, or a set
    of more effects that the free run does not tell. And beside the same effects, which the free run does not tell:
    fitted twice, they leave the same but for the search.
    """
    best, word = state.judged.best, state.judged.word
    if best is None:
        return 1.0
    curve = word == "unnamed" and {site for site, _ in best.names} == {site for site, _ in names}
    larger = word == "abstain" and len(best.names) > len(names)
    same = word == "abstain" and set(best.names) == set(names)
    return 1 + MUCH_WORSE if curve or larger or same else 1.0


def smaller(error: tuple[OutputChange, ...], than: tuple[OutputChange, ...], allowed: float) -> bool:
    """Whether errors on the report rows are below `allowed` times others, by the geometric mean over the outputs."""
    with np.errstate(all="ignore"):
        ratios = [np.log(a.after / b.after) for a, b in zip(error, than, strict=True) if a.after > 0 and b.after > 0]
    return not ratios or float(np.mean(ratios)) < float(np.log(allowed))


def hardly_explained(changes: tuple[OutputChange, ...], above: float = FAR_ABOVE, share: float = EXPLAINED) -> bool:
    """Whether an output is far above its noise, and too little of what its squared error is above that is removed.

    Then something else is the matter, which any name may stand in for, see `explains_too_little`.
    """
    return any(explains_too_little(c.before, c.after, c.noise, above, share) for c in changes)


def explains_too_little(before: float, after: float, usual: float, above: float, share: float = EXPLAINED) -> bool:
    """Whether an error is far above what is usual, and too little of what its square is above that is removed.

    With the errors b before and a after, and the noise or usual error s::

        b > above s    and    (a^2 - s^2) > (1 - share) (b^2 - s^2)
    """
    return before > above * usual and after**2 - usual**2 > (1 - share) * (before**2 - usual**2)


def not_two(search: Search, base: Explanation, told: Told) -> Told:
    """Nothing where two effects are needed, named or of a class, and neither is a store, which most models leave out.

    Two things that have gone wrong at a time are rarer than a model that is wrong in a third way, which two effects
    stand in for. A store and a dependence are two such effects as well, or two stores: both say how the process is. A
    gauge that slips was told as two stores, at the inflow and at the outflow. Of a class, one explanation without a
    second effect is enough. A constant error and an event at one site are one thing: its level before and after.

    An event that stands by itself (see `stands_by_itself`) is told without the other effect, which stays open: a gyro
    that came to show more was found to the row beside a law of the ship that is a little wrong.
    """
    levels = {h.site for h in told.certain if h.driver == "constant"}
    kinds = [h.kind for h in told.certain if not (h.kind in EVENTS and h.site in levels)]
    beside = kinds and all(h.kind in EVENTS and h.site in levels for _, h in told.open)
    if told.word == "class" and all(_of_two(e) for e in told.alike) and not beside:
        one = f"one of {', '.join(h.label for _, h in told.open)}"
        said = " and ".join([*(h.label for h in told.certain), one]) if told.certain else f"{one}, and a further one"
    elif len(kinds) < 2 or (kinds.count("store") == 1 and not {"depends", "turns"} & set(kinds)):
        return told
    else:
        said = " and ".join(h.label for h in told.certain)
    alone = _event_by_itself(search, base, told)
    if alone is not None:
        return replace(told, word="named", best=alone, certain=alone.hypotheses, open=())
    why = f"two effects are needed, {said}: more likely another one is"
    return replace(told, word="abstain", certain=(), open=(), why=why)


def two_and_more(told: Told, changes: tuple[OutputChange, ...]) -> bool:
    """Whether effects at two places are told, and an output stays far above its noise (FAR_ABOVE) with them.

    Then a third thing is missing, which both may stand in for: a reactor's jacket that fouls was a late cooler with a
    hidden store.
    """
    places = {h.site for h in told.certain} | ({""} if told.open else set())
    return len(places) > 1 and any(c.after > FAR_ABOVE * c.noise for c in changes)


def _event_by_itself(search: Search, base: Explanation, told: Told) -> Explanation | None:
    """The event that is certain of two effects, without the other one, where it stands by itself; else None."""
    events = [h for h in told.certain if h.kind in EVENTS]
    if len(told.best.hypotheses) != 2 or len(events) != 1:
        return None
    (other,) = (h for h in told.best.hypotheses if h is not events[0])
    alone, without = search.without(told.best, other), search.without(told.best, events[0])
    changes = changes_within(events[0], search.record)
    criteria = (e.criterion for e in (told.best, base, alone, without))
    return alone if stands_by_itself(changes, *criteria) else None


def _of_two(explanation: Explanation) -> bool:
    return len(explanation.hypotheses) > 1 and all(h.kind != "store" for h in explanation.hypotheses)


def unless_it_wanders(search: Search, base: Explanation, told: Told) -> Told:
    """Nothing where an event is told, and at its site about as much happens at other times.

    An event is there or not. What wanders goes up and down all the time, and the largest of its swings looks like one:
    beside that, a further switch at the site gains about as much (WANDERS). A switch is found where it gains
    LEAST_GAIN, so an event that gains less than LEAST_GAIN / WANDERS can not be told from what wanders.

    One that comes again and again is held against a random walk (see `walking`). Where that explains as much, a single
    spell that explains most of it (ONCE) is told in its place, or nothing.
    """
    event = next((h for h in told.best.hypotheses if _begins(h) and h in told.effects), None)
    if told.word not in WITH_A_NAME or event is None:
        return told
    rest = base if len(told.best.hypotheses) == 1 else search.without(told.best, event)
    gain = told.best.criterion - rest.criterion
    if comes_again(event) and gain_of_a_walk(search, told.best, rest, event) > gain - LEAST_GAIN:
        once = _with_single_spells(search, base, told)
        if once is None:
            why = f"{event.site} changes again and again, as what wanders does"
            return replace(told, word="abstain", certain=(), open=(), why=why)
        return once
    if WANDERS * gain < LEAST_GAIN:
        why = f"{event.site} changes so little that what wanders may do it: no search would find a further such change"
    elif wanders(search, told.best, event, gain):
        why = f"{event.site} changes about as much at other times, so that it wanders"
    else:
        return told
    return replace(told, word="abstain", certain=(), open=(), why=why)


def _with_single_spells(search: Search, base: Explanation, told: Told) -> Told | None:
    """The same, each event that comes again and again there once; None where that explains less than ONCE of it."""

    def single(explanation: Explanation) -> Explanation | None:
        event = next((h for h in explanation.hypotheses if comes_again(h)), None)
        if event is None:
            return explanation
        rest = base if len(explanation.hypotheses) == 1 else search.without(explanation, event)
        once = told_once(search, explanation, rest, event)
        least = ONCE * (explanation.criterion - rest.criterion)
        return once if once is not None and once.criterion - rest.criterion >= least else None

    def same(h: Hypothesis, explanation: Explanation) -> Hypothesis:
        return next(own for own in explanation.hypotheses if own.effect.label == h.effect.label)

    opened = []
    for explanation, h in told.open:
        once = single(explanation)
        if once is None:
            return None
        opened.append((once, same(h, once)))
    best = opened[0][0] if opened else single(told.best)
    if best is None:
        return None
    certain = tuple(same(h, best) for h in told.certain)
    alike = tuple(e for e, _ in opened) or (best,)
    return replace(told, best=best, certain=certain, open=tuple(opened), alike=alike)


def unless_a_trend(base: Explanation, told: Told) -> Told:
    """Nothing where an event is told that lasts to the end, and it gains little (TREND): what wanders slowly does that.

    What wanders over about as long as a record is long goes one way in it. A reference of that length shows one such
    course, and not how large the next one is; without a reference none is known.
    """
    lasting = any(_lasts(h) for h in told.effects)
    if told.word not in WITH_A_NAME or not lasting or told.best.criterion - base.criterion >= TREND:
        return told
    why = "a change that lasts to the end, and is so small, may be what wanders in the process"
    return replace(told, word="abstain", certain=(), open=(), why=why)


def unless_hardly_off(told: Told) -> Told:
    """Nothing where an event is told that stops for little but short pauses, which the record asks for.

    What is switched off for 6 s between spells of 180 s is hardly switched. A lasting change of another form looks like
    that: a ship whose inertia has doubled was told as a rudder, in five spells. Where what has no site is told beside
    it, that is said already.
    """
    event = next((h for h in told.best.hypotheses if is_hardly_off(h) and h in told.effects), None)
    if told.word not in WITH_A_NAME or event is None or told.beside:
        return told
    why = f"{event.site} would be as usual only for short pauses, so that it stands in for something that lasts"
    return replace(told, word="abstain", certain=(), open=(), why=why)


def _begins(h: Hypothesis) -> bool:
    """Whether it is an event, of the search or of a free run."""
    return h.kind in EVENTS or bool(h.effect.names(CoefficientRole.ONSET))


def _lasts(h: Hypothesis) -> bool:
    """Whether it is an event that lasts to the end; of a free run any, whose forms tell that in several ways."""
    return len(h.pulses) == 1 and h.pulses[0][1] >= FOREVER if h.kind in EVENTS else _begins(h)


def late_as_well(state: State, told: Told, site: str) -> bool:
    """Whether a lag or dead time at a site explains about as much in a free run as what is told, each alone.

    A free run has no process noise whose assumed way to wander would tell the order of lags (see `late_where`).
    """
    named = next((h for h in told.certain if h.kind == "lag"), None)
    gain = state.late.get((named.site, named.driver), 0.0) if named is not None else 0.0
    return named is not None and state.late.get((site, named.driver), 0.0) >= (1 - NEAR) * gain > 0


def surely_worse(changes: tuple[OutputChange, ...], noise: FloatArray) -> bool:
    """Whether the error of a free run surely grows, beyond the noise."""
    return any(c.after > AT_NOISE * s and c.reduction95[1] < 0 for c, s in zip(changes, noise, strict=True))


def _free_course(effect: Effect) -> bool:
    return effect.driver == "time" and effect.family.is_curve
