"""The verdict on a cause that the innovations form has found in a record with a reference.

Where no single hypothesis makes free runs surely better, what wanders in the process may be most of their error. Then
errors over stretches of a tenth of the record decide, each predicted from the state of the filter before it. They must
fall to what the reference has over such stretches: else something else is the matter.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from adaptive_flot.discovery.hypotheses.calibration import excluded_by
from adaptive_flot.discovery.hypotheses.cross_validation import Tested, fit_all_rows, fitted_and_tested
from adaptive_flot.discovery.hypotheses.families import EVENTS, Hypothesis
from adaptive_flot.discovery.hypotheses.judgement import Judged
from adaptive_flot.discovery.hypotheses.procedure import SIZES_OPEN, Comparison
from adaptive_flot.discovery.hypotheses.telling import ABOVE_USUAL, verdict_of, what_is_left
from adaptive_flot.discovery.innovations.in_words import told_in_words, words_at
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.innovations.verdicts.reach import outputs_in_reach
from adaptive_flot.discovery.innovations.verdicts.rivals import hardly_explained
from adaptive_flot.discovery.innovations.verdicts.stretches import errors_over_folds, usual_over_folds
from adaptive_flot.discovery.results import Judgement, NamedEffect
from adaptive_flot.discovery.results.words import LARGEST_CLASS, NORMAL95, WITH_A_NAME
from adaptive_flot.discovery.verdict.report_veto import contradiction
from adaptive_flot.discovery.verdict.words.wording import HAS_CHANGED

JUDGED_ON = "held-out stretches, each from the state of the filter before it"
MOST = 0.8
"""Share of what is unusual that a cause must explain: what is left may be another cause, or the right one."""


def with_cause(
    compared: Comparison,
    search: Search,
    base: Explanation,
    told: Told,
    reference: tuple[Search, Explanation],
) -> Comparison:
    """The comparison with the cause told; unchanged where errors over stretches do not fall to those of the reference.

    Unchanged, too, where without the cause none of them is above ABOVE_USUAL times that of the reference: there is
    nothing to explain then. Only outputs that the cause can change are asked.

    Parameters
    ----------
    compared
        The comparison of the whole record.
    search, base, told
        The search in innovations form, the model as it is in the new record, and what was judged.
    reference
        The search in the reference, and the model as it is there.
    """
    found = _tested(compared, search, told)
    if not found:
        return compared
    error = errors_over_folds(search, base, told.best)
    usual = usual_over_folds(*reference)
    error = tuple(replace(c, noise=usual[c.output]) for c in error)
    reached = set(outputs_in_reach(search.model, search.model_of(told.best)))
    shown = tuple(c for c in error if c.output in reached)
    if all(c.before <= ABOVE_USUAL * c.noise for c in shown):
        return compared
    word: Literal["named", "class"] = "named" if told.word == "named" else "class"
    if _too_many_parts(compared, told):
        return compared
    against = contradiction(Judgement(word, None, (), (), 0.0), error, np.array([c.noise for c in error]))
    if against or hardly_explained(shown, ABOVE_USUAL, MOST):
        return compared
    judged = Judged(word, found[0], tuple(found[1:]), "", float("nan"), told.beside)
    calibration = replace(compared.calibration, model=search.model)
    verdict = verdict_of(
        calibration, compared.rows, compared.blocks, compared.null, judged, True, compared.verdict.seconds
    )
    over_hours = what_is_left(verdict.error, reference=True)  # of free runs, and these are errors over stretches
    notes = (*what_is_left(error, reference=True), *(n for n in verdict.notes if n not in over_hours))
    if excluded_by(compared.calibration, found[0].fit):
        notes = (*notes, SIZES_OPEN)
    said, (first, _, _) = ", ".join(c.words for c in error), compared.verdict.reason.partition(". ")
    lasting = word == "named" and not any(h.kind in EVENTS for h in told.effects)  # an event has its time beside it
    changed = f"{told_in_words(search, told)} {HAS_CHANGED if lasting else ''}".rstrip()
    reason = f"{changed} Error over held-out stretches, each from the filter's state: {said}."
    alone = f"Free runs over the whole record, without process noise, {_as_well(compared, told)}: {first}."
    return replace(
        compared,
        verdict=replace(
            verdict,
            reason=reason,
            effects=tuple(_with_sizes_told(search, told, e) for e in verdict.effects),
            error=error,
            split=JUDGED_ON,
            notes=(*notes, alone),
        ),
        model=search.model_of(told.best),
        calibration=calibration,
        tested=(*found, *compared.tested),
        judged=judged,
    )


def _with_sizes_told(search: Search, told: Told, named: NamedEffect) -> NamedEffect:
    """The effect with the sizes of the sentence, which are those of the innovations form, and their intervals."""
    explanation, h = _told_effects(told)[0]
    effect = search.model_of(explanation).fitted_effects()[-1]
    values, P = search.sizes(explanation)
    std = dict(zip(values, np.sqrt(np.diag(P)), strict=True))
    around = {c: (v, NORMAL95 * std[name]) for c in h.free for name in [effect.parameter(c)] for v in [values[name]]}
    own = {c: (v - reach, v + reach) for c, (v, reach) in around.items()}
    return replace(
        named, effect=effect, meaning=words_at(search, explanation, h), interval95={**named.interval95, **own}
    )


def _as_well(compared: Comparison, told: Told) -> str:
    """Whether free runs tell the same part, another one, or none."""
    verdict = compared.verdict
    if verdict.word not in WITH_A_NAME:
        return "do not tell it. They say"
    return "say so, too" if verdict.sites & {h.site for h in told.effects} else "say something else"


def _too_many_parts(compared: Comparison, told: Told) -> bool:
    """Whether free runs do not tell more parts apart than a class may hold, and one of them is not told.

    What tells that part from the others is then no more than how the filter lets the process wander.
    """
    parts = {t.hypothesis.site for t in compared.judged.parts if t.hypothesis is not None}
    return len(parts) > LARGEST_CLASS and not parts <= {h.site for h in told.effects}


def _told_effects(told: Told) -> list[tuple[Explanation, Hypothesis]]:
    """What is told, each with the explanation that has it."""
    return [(told.best, h) for h in told.certain] if told.word == "named" else list(told.open)


def _tested(compared: Comparison, search: Search, told: Told) -> list[Tested]:
    """The effects that are told, one by one in free runs; none where there is more than one beside another."""
    effects = _told_effects(told)
    alone = not (told.certain and told.open) and max((len(e.hypotheses) for e, _ in effects), default=0) == 1
    if told.word not in WITH_A_NAME or not alone:
        return []
    constants = search.known or compared.calibration.constants
    first = fit_all_rows(search.model, compared.rows, None, constants, None)
    assert first is not None  # the model as it is can be simulated
    model, rows = search.model, compared.rows
    fits = [fitted_and_tested(model, rows, search.started(e, h), constants, first.fit) for e, h in effects]
    tested = [t for t in fits if t is not None]
    return tested if len(tested) == len(effects) else []
