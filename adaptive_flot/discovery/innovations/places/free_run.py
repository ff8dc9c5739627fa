"""What a free run tells without a reference, beside what acts where the model has no site.

A shaft carries more than the model's fixed inertia, and a friction that follows its twist explains that as well. So
before one effect is told, a constant change is fitted at each further place, with the constants free. Where one
explains the record surely better, nothing is told; where it explains as much, it is a member of the class. Where an
event is told, one of its shape is fitted there, too: a chamber that leaks from some time on is no positioner that fell.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

import numpy as np

from adaptive_flot.discovery.assessment.likelihood import loglik_difference_sds
from adaptive_flot.discovery.candidates.catalogue import nameable, passed_on
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.further_sites.places import further_sites, is_possible, with_further_sites
from adaptive_flot.discovery.further_sites.same_meaning import is_meant, twins
from adaptive_flot.discovery.further_sites.wording import as_if, change_in_words
from adaptive_flot.discovery.innovations.filter.thinning import searchable
from adaptive_flot.discovery.record.seen import seen_along
from adaptive_flot.discovery.results import Alternative, Judgement, State
from adaptive_flot.discovery.results.words import LARGEST_CLASS, WITH_A_NAME
from adaptive_flot.discovery.verdict.judge import LEAST_MARGIN
from adaptive_flot.greybox.effects import Effect, Mode
from adaptive_flot.greybox.forms.form import CoefficientRole
from adaptive_flot.greybox.model import Model
from adaptive_flot.parallel import parallel_map


def compare_with_what_has_no_site(state: State) -> State:
    """Take a name or a class of the free run back, or add a member to it, where a place without a site asks for that.

    What the innovations form tells has been compared already. Only for a model that is small enough for that form: a
    large one takes too long.
    """
    problem, result = state.searched
    model = result.base.model
    judged = state.judged if state.sentence else or_the_part_itself(model, with_twins(model, state.judged))
    state = state if judged is state.judged else replace(state, judgement=judged)
    best = judged.best
    told = judged.word in WITH_A_NAME and not state.contradiction and not state.sentence
    if not told or best is None or len(best.names) != 1 or judged.part or problem.background is not None:
        return state
    if searchable(problem.record, result.base.model) is None or time.monotonic() > state.ends:
        return state
    state.progress("compare with what has no site")
    rivals = _rivals(state)
    if not rivals:
        return state
    first = rivals[0]
    least = LEAST_MARGIN * result.rows_per_effective_sample
    words = [_words(a) for a in rivals if a.near(first, least)]
    if not best.near(first, least):
        return replace(
            state,
            judgement=replace(judged, word="abstain", members=()),
            contradiction=f"what has no site explains more, {as_if(words)}",
        )
    # what comes as near as the farthest member of a class is one of them
    members = judged.members if judged.word == "class" else best.names
    others = (a for a in result.alternatives if len(a.names) == 1 and a.names[0] in members and judged.near(a))
    farthest = max((a.worse_than(best) for a in others), default=0.0)
    if not first.near(best, max(farthest, least)):
        return state
    if len(members) >= LARGEST_CLASS:
        return replace(state, judgement=replace(judged, word="abstain", members=()))
    judged = replace(judged, word="class", members=(*members, *first.names), beside=words[0])
    return replace(state, judgement=judged)


def or_the_part_itself(model: Model, judged: Judgement) -> Judgement:
    """The judgement; a class with an actuator where what depends on its input does the same as its own curve would.

    A doser at its limit gives less where much is asked. A demand of the water that grows with the dose is the same.

    Parameters
    ----------
    model
        The model as it is.
    judged
        What a free run tells.
    """
    best = judged.best
    if judged.word not in WITH_A_NAME or best is None or len(best.names) != 1 or judged.part:
        return judged
    (effect,), told = best.effects, judged.members or best.names
    asked, sites = passed_on(model), {site for site, _ in told}
    acting = [s.name for s in model.sites if s.role == "actuator" and asked.get(s.name) == effect.driver]
    if sites.issuperset(acting):  # nothing is worked out for what depends on no actuator's input
        return judged
    alike = {s.name for s in twins(model, effect)}
    further = [(part, "own_value") for part in acting if part in alike and part not in sites]
    if not further:
        return judged
    if len(told) + len(further) > LARGEST_CLASS:
        return replace(judged, word="abstain", members=())
    return replace(judged, word="class", members=(*told, *further))


def with_twins(model: Model, judged: Judgement) -> Judgement:
    """The judgement; a name of several effects is a class where one of them does the same at another site.

    A search beside the first effect has the others at that site only. What depends on the same as that one may make up
    for its shape: it is not told.

    Parameters
    ----------
    model
        The model as it is.
    judged
        What a free run tells.
    """
    best = judged.best
    if judged.word != "named" or best is None or len(best.names) < 2 or judged.part:
        return judged
    alike = []
    for k, effect in enumerate(best.effects):
        for site in twins(model, effect):
            if nameable(model, site, effect.driver):
                names = (*best.names[:k], (site.name, effect.driver), *best.names[k + 1 :])
                alike.append(replace(best, names=names))
    if not alike:
        return judged
    members = tuple(dict.fromkeys(name for a in (best, *alike) for name in a.names))
    changing = tuple(n for n in members if not all(n in a.names for a in (best, *alike)))
    same_driver = len({driver for _, driver in members}) == 1
    part = changing[:1] if same_driver and len(changing) < len(members) else ()
    rivals = (*alike, *judged.rivals)
    return replace(judged, word="class", members=changing if part else members, part=part, rivals=rivals)


def _rivals(state: State) -> list[Alternative]:
    """A change at each place, fitted; the best first, without what says the same as what is told."""
    (problem, result), judged = state.searched, state.judged
    assert judged.best is not None  # something is told
    base, model = result.base, with_further_sites(result.base.model)
    told = judged.best.effects[0]
    free = tuple(c for c in told.coefficients if told.parameter(c) in judged.best.fit.names)
    changes = [
        change
        for s in further_sites(model)
        if not is_meant(model, told, s.name)
        for change in _changes(s.name, s.mode, told, free)
    ]

    def fitted(change: tuple[Effect, tuple[str, ...]]) -> Fit | None:
        effect, coefficients = change
        own = tuple(effect.parameter(c) for c in coefficients)
        with np.errstate(all="ignore"):
            return Fitter(problem).fit(model.with_effects([effect]), own, like=base)

    seen, _ = seen_along(model, problem.record, base.initial_state)
    found = []
    for (effect, _), own in zip(changes, parallel_map(fitted, changes, state.processes), strict=True):
        if own is None:
            continue
        fit = own.with_model(partial(model.with_effects, [effect]))
        a = Alternative(((effect.site, effect.driver),), (False,), fit, base.loss - fit.loss, fit.bic - base.bic)
        if is_possible(model, problem.record, effect.site, _amount(a), seen[effect.site]):
            found.append(a)
    found = [a for a in found if a.delta_bic < -LEAST_MARGIN]
    if not found:
        return []
    sds = loglik_difference_sds(problem, judged.best.fit, [a.fit for a in found])
    apart = (replace(a, loglik_difference_sd=sd) for a, sd in zip(found, sds, strict=True))
    best: dict[str, Alternative] = {}
    for a in sorted(apart, key=lambda a: a.fit.bic):
        best.setdefault(a.effects[0].site, a)
    return list(best.values())


def _changes(place: str, mode: Mode, told: Effect, free: tuple[str, ...]) -> list[tuple[Effect, tuple[str, ...]]]:
    """What may act at a place, each with what is fitted: a constant, and where an event is told, one of its shape.

    It starts at the times of the event, and from nothing.
    """
    constant = Effect(place, "constant", "shift", mode=mode)
    changes: list[tuple[Effect, tuple[str, ...]]] = [(constant, ("amplitude",))]
    if told.driver == "time":
        levels = told.names(CoefficientRole.LEVEL, CoefficientRole.KNOT_VALUE)
        start = {c: 0.0 if c in levels else value for c, value in told.coefficients.items()}
        changes.append((replace(told, site=place, mode=mode, coefficients=start), free))
    return changes


def _amount(a: Alternative) -> float:
    """The change at a place that is farthest from none."""
    return max(a.effects[0].levels, key=abs, default=0.0)


def _words(a: Alternative) -> str:
    effect, model = a.effects[0], a.fit.model
    onsets = effect.values(CoefficientRole.ONSET)
    sometimes = "for some of the time" if effect.driver == "time" else ""
    when = f"from {onsets[0]:.0f} s on" if len(onsets) == 1 else sometimes
    return change_in_words(model, effect.site, _amount(a), when, measured=False)
