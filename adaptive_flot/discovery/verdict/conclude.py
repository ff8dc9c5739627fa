"""The verdict itself: what was judged, with errors, tests, intervals and words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.assessment.swings import swing_notes
from adaptive_flot.discovery.assessment.verification import block_rows, changes, whiteness
from adaptive_flot.discovery.candidates.catalogue import has_a_reason
from adaptive_flot.discovery.candidates.direction import against, listed
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.moved_inputs import MOVED
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.record.screening import Screening
from adaptive_flot.discovery.record.slip_jump import band_ranges
from adaptive_flot.discovery.results import Judgement, NamedEffect, OutputChange, SearchResult, State, Verdict
from adaptive_flot.discovery.results.least_shown import what_is_hidden, what_is_shown
from adaptive_flot.discovery.results.words import NORMAL95, TELLING
from adaptive_flot.discovery.verdict.locate import locate
from adaptive_flot.discovery.verdict.report_veto import much_better
from adaptive_flot.discovery.verdict.words.curve import EffectCurve, effect_curves
from adaptive_flot.discovery.verdict.words.sizes import words_of_effects
from adaptive_flot.discovery.verdict.words.suspects import suspect_notes
from adaptive_flot.discovery.verdict.words.thresholds import with_ranges
from adaptive_flot.discovery.verdict.words.wording import (
    beside_words,
    drift_words,
    reason_words,
    still_wrong_or_wandering,
)
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.data.stretches import LONGEST_IS_USED
from adaptive_flot.greybox.effects import LATE, Effect
from adaptive_flot.greybox.forms.form import Coefficient, CoefficientRole
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.stepping.record import RecordSimulator

TIMES = (CoefficientRole.TIME_CONSTANT, CoefficientRole.DEAD_TIME, CoefficientRole.DURATION, CoefficientRole.PERIOD)
FAR = 50.0
"""Logarithm of a factor that says nothing any more."""
INSTRUMENTS = {"sensor": "sensor", "actuator": "part that acts", "feed": "feed"}
"""Roles whose quantities do not depend on the state of the process, in words."""

SIZES_WITH_PROCESS_NOISE = (
    "sizes are those of the fit with process noise, errors and parameters those of free runs; a disturbance that stays "
    "for most of the record is part of a size, and not of its interval"
)
LATE_SENSOR = "A sensor that answers late looks like a store or a transport before it that the model lacks."
STILL_WRONG = 2.0
"""An output whose error on the report rows is more than so many times its noise is wrong after all."""


def insufficient(screening: Screening) -> Verdict:
    """The verdict on a record that says too little, with every reason."""
    reason = "The record does not say enough: " + "; ".join(screening.reasons) + "."
    return Verdict("insufficient", reason, notes=screening.notes, shortcomings=screening.reasons)


def conclude(state: State) -> Verdict:
    """The verdict on a record that was searched."""
    (problem, result), judgement, (before, after) = state.searched, state.judged, state.refitted
    tells = judgement.word in TELLING
    final = before if judgement.best is None else after
    labels = [after.model.parameters[after.model.index("parameters", n)].label for n in problem.adapted]
    values = final.values[: len(labels)]
    effects = _effects(judgement, state.told, problem.record) if tells else ()
    if any(e.effect.family.memory for e in effects):
        effects = with_ranges(effects, _curves(state, effects), problem.record.dt)
    drift = drift_words(judgement, after) if judgement.word == "none" and judgement.best else ()
    return Verdict(
        word=judgement.word,
        reason=_reason(state, effects, drift),
        effects=effects,
        members=judgement.members,
        error=state.error,
        report_times=problem.spans("report") if state.report_record is None else (),
        tests=_tests(problem, before, final),
        parameters=dict(zip(labels, map(float, values), strict=True)),
        drift=drift,
        absorbed={
            k: float(b / a - 1) if a else float("nan")
            for k, b, a in zip(labels, before.values[: len(labels)], values, strict=True)
        },
        notes=state.screening.notes
        + _beside(state)
        + _common_nuisance_note(result)
        + ((SIZES_WITH_PROCESS_NOISE,) if state.sizes else ())
        + suspect_notes([e.effect for e in effects], state.screening.suspects, problem.record.dt)
        + (_swings(problem, before) if judgement.word == "abstain" else ())
        + what_is_shown(state.least_shown),
        detection=state.detection,
        location=locate(state.detection, result.rounds[0].scores) if state.detection else None,
        experiment=state.experiment,
        least_shown=state.least_shown,
    )


def _beside(state: State) -> tuple[str, ...]:
    """A note on what acts where the model has no site, where something else is told."""
    if not state.without_a_site or _acts_without_a_site(state):
        return ()
    return (f"with process noise it is {state.without_a_site}",)


def _swings(problem: Problem, before: Fit) -> tuple[str, ...]:
    """Notes on errors of the model as it is that swing with a period."""
    return swing_notes(before.model, problem.record, problem.columns, before.residual(problem))


def _reason(state: State, effects: tuple[NamedEffect, ...], drift: tuple[str, ...]) -> str:
    """The verdict in one paragraph: in the words of the innovations form where that has decided."""
    wrong = [c.output for c in state.error if c.after > STILL_WRONG * c.noise]
    if not state.sentence:
        told = words_of_effects(state.told.model, effects, _curves(state, effects)) if effects else ""
        said = reason_words(state.judged, state.searched[1], effects, drift, state.contradiction, wrong, told)
        likelier = beside_words(state.likelihood, much_better(state.error))
        hidden = what_is_hidden(state.least_shown)
        part = _part_of_record(state.screening.notes)
        where = ""
        if _acts_without_a_site(state):
            where = f"Something is missing. It is {state.without_a_site}."
            said = f"Free runs do not tell it: {_rest(said)}"
        late = _looks_like_a_store(state)
        return " ".join(filter(None, (where, said, late, likelier, state.certain, hidden, state.background, part)))
    errors = ", ".join(c.words for c in state.error)
    told = f"{state.sentence} Error of the free run on held-out rows: {errors}."
    left = still_wrong_or_wandering(wrong) if state.judged.word in TELLING else ""
    late = _looks_like_a_store(state)
    return " ".join(filter(None, (told, late, left, state.certain, _part_of_record(state.screening.notes))))


def _looks_like_a_store(state: State) -> str:
    """A word on a sensor that answers late, where no reference has shown that the model has all stores before it.

    A first-order lag of an output is the same equation in both cases.
    """
    judged = state.judged
    if state.referred or judged.word not in TELLING or judged.best is None:
        return ""
    sensors = {site.name for site in state.model.sites if site.role == "sensor"}
    told = (*(judged.part or judged.best.names), *judged.members)
    return LATE_SENSOR if any(site in sensors and driver in LATE for site, driver in told) else ""


def _acts_without_a_site(state: State) -> bool:
    """Whether nothing is told, but where the model lacks a site: that comes first."""
    return bool(state.without_a_site) and state.judged.word == "abstain"


def _rest(said: str) -> str:
    """A reason to abstain without its beginning, which is said before."""
    for begin in (
        "Something is missing, but it is not told: ",
        "Something is missing, but the record does not say what: ",
    ):
        said = said.removeprefix(begin)
    return said


def _part_of_record(notes: Sequence[str]) -> str:
    """A word on what a verdict is about: where a hole has left only one stretch of the record, or inputs were moved."""
    left = next((note for note in notes if LONGEST_IS_USED in note), "")
    moved = next((note for note in notes if note == MOVED), "")
    rows = left.rpartition(" with ")[2]  # the note says why
    said = (f"This is about a part of the record, {rows}." if left else "", f"Note: {moved}." if moved else "")
    return " ".join(filter(None, said))


def _curves(state: State, effects: tuple[NamedEffect, ...]) -> tuple[EffectCurve, ...]:
    """Curves of the effects that are told, over what the record covers of their drivers."""
    best, problem = state.judged.best, state.problem_after or state.known_problem
    told = {e.effect.label for e in effects}
    curves = effect_curves(problem, state.told, len(best.names)) if best else ()
    return tuple(c for c in curves if c.effect.label in told)


def _tests(problem: Problem, before: Fit, after: Fit) -> dict[str, float]:
    """Ljung-Box p value of the residual of each output before and after, and of the first output by itself."""
    tests = {f"ljung_box_before_{k}": p for k, p in whiteness(problem, before, raw=True).items()}
    tests |= {f"ljung_box_after_{k}": p for k, p in whiteness(problem, after, raw=True).items()}
    first = before.model.outputs[problem.columns[0]].name
    return tests | {f"ljung_box_{k}": tests.get(f"ljung_box_{k}_{first}", float("nan")) for k in ("before", "after")}


def report_errors(problem: Problem, before: Fit, after: Fit, report: Dataset | None) -> tuple[OutputChange, ...]:
    """Free-run errors on the report split, or on a record of its own that reports."""
    if report is None:
        return changes(problem, before, after, "report")
    there = _on_record(problem, report, before, after)  # a problem without rows that were fitted
    return changes(*there, "report", block_rows(problem, before, after))


def _on_record(problem: Problem, record: Dataset, before: Fit, after: Fit) -> tuple[Problem, Fit, Fit]:
    """Free runs of fits over another record from their own initial state: its problem and the fits with them."""
    n, columns = len(record), list(problem.columns)
    everywhere = np.full(n, "report", dtype="<U8")
    there = replace(problem, record=record, splits=everywhere, weights=np.ones((n, len(columns))))

    def run(fit: Fit) -> Fit:
        free = RecordSimulator(fit.model, record.dt).outputs(record, fit.initial_state, fit.model.parameter_values)
        return replace(fit, predicted=free[:, columns])

    return there, run(before), run(after)


def _common_nuisance_note(result: SearchResult) -> tuple[str, ...]:
    if result.common_nuisance is None:
        return ()
    site, driver = result.common_nuisance
    return (f"close alternatives were compared with what they leave, {site} by {driver}, added to each",)


def _effects(judgement: Judgement, told: Fit, record: Dataset) -> tuple[NamedEffect, ...]:
    """Each effect that is told, with Wald intervals and the names that could replace it."""
    assert judgement.best is not None  # a verdict that names has an alternative
    model, best = told.model, judgement.best
    std = dict(zip(told.names, told.std(), strict=True))
    named = []
    for i, effect in enumerate(model.fitted_effects()[-len(best.names) :]):
        own = best.names[i]
        if judgement.part and own not in judgement.part:
            continue
        others = tuple(
            (*instead[0], a.worse_than(best), a.loglik_difference_sd)
            for a in judgement.rivals
            if len(instead := [n for n in a.names if n not in best.names]) == 1
            and set(best.names) - set(a.names) == {own}
        )
        interval = {
            c.name: wald(c, effect.coefficients[c.name], std[effect.parameter(c.name)])
            for c in effect.terms
            if c.name in effect.coefficients and effect.parameter(c.name) in std
        }
        interval |= band_ranges(model, effect, (record,), (told.initial_state,))
        named.append(NamedEffect(effect, _meaning(model, effect), interval, others))
    return tuple(named)


def wald(coefficient: Coefficient, value: float, std: float) -> tuple[float, float]:
    """Wald's 95 % interval of a fitted coefficient, inside the range of the coefficient.

    Of a coefficient c with a standard deviation s, and of a time in its logarithm, since it is above zero::

        c -+ 1.96 s        c exp(-+ 1.96 s / c)
    """
    if coefficient.role in TIMES and value > 0:
        reach = float(np.exp(min(NORMAL95 * std / value, FAR)))
        low, high = value / reach, value * reach
    else:
        low, high = value - NORMAL95 * std, value + NORMAL95 * std
    return max(low, min(value, coefficient.lower)), min(high, max(value, coefficient.upper))


def _meaning(model: Model, effect: Effect) -> str:
    """What the table of known effects says of an effect; why it has no name; empty where site and driver say it all."""
    known = listed(model, effect)
    if known is None:
        site = next(s for s in model.sites if s.name == effect.site)
        if site.role in INSTRUMENTS and not has_a_reason(model, site, effect.driver):
            return f"without a name, since a {INSTRUMENTS[site.role]} has no reason to depend on it"
        return "not listed among the effects known for this model" if model.known_effects else ""
    return f"the other way than: {known.meaning}" if against(model, effect) else known.meaning
