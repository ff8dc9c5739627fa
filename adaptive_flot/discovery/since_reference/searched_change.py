"""What the search of a single record finds since a reference, where no simple hypothesis of the whole record is told.

Hypotheses of the whole record are single faults of one part. A dependence of a shape of its own, a slow change, a part
with two lags, or two effects are found by the search, as without a reference. The reference helps it in three ways: the
constants are known, errors must fall to those that are usual, and what the model lacks there too has not changed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.hypotheses.cross_validation import Fitted, Tested, fit_all_rows
from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.hypotheses.joint.rows import Rows
from adaptive_flot.discovery.hypotheses.judgement import Judged
from adaptive_flot.discovery.hypotheses.procedure import Comparison
from adaptive_flot.discovery.hypotheses.telling import ABOVE_USUAL, what_is_left
from adaptive_flot.discovery.innovations.places.constants import DOES_THE_SAME
from adaptive_flot.discovery.innovations.search.explanation import LEAST_GAIN
from adaptive_flot.discovery.innovations.verdicts.cause import MOST
from adaptive_flot.discovery.innovations.verdicts.rivals import hardly_explained
from adaptive_flot.discovery.results import Discovery, OutputChange, Verdict
from adaptive_flot.discovery.results.words import WITH_A_NAME
from adaptive_flot.discovery.stages import NONE_FITTED, NOT_ALL_TRIED
from adaptive_flot.discovery.verdict.words.wording import since_reference
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model

MOST_SECONDS = 120.0
"""Longest time of the search: where a model is far off, it tries much. What is cut short tells nothing. It takes 20 to
45 s on a quiet machine; with 45 s, a busy one lost what a quiet one told."""
BETTER = 0.8
"""What is told already is replaced where errors fall to so many times those with it, by their geometric mean."""
AT_NOISE = 1.25
"""Errors of at most so many times the noise from row to row are noise."""
REPORT_ROWS = "free run, report rows, which nothing was fitted to"
SEARCHED: Literal["alternative"] = "alternative"
"""Kind of what the search has found, of any shape."""


def with_searched_effect(
    compared: Comparison,
    record: Dataset,
    processes: int,
    progress: Callable[[str], None],
    budget: float = MOST_SECONDS,
) -> Comparison:
    """The comparison with what the search tells; unchanged where it tells nothing, or nothing that is new.

    Parameters
    ----------
    compared
        The comparison of the record with its reference.
    record
        The record.
    processes, progress
        Fits at once, and a word for each stage.
    budget
        Seconds that the search may take, at most MOST_SECONDS.
    """
    calibration = compared.calibration
    held = with_constants_held(calibration.model, calibration.constants.names)
    limit = min(budget, MOST_SECONDS)
    found = discover(held, record, processes=processes, progress=progress, budget=limit, referred=True)
    verdict = found.verdict
    if verdict.word not in WITH_A_NAME or not verdict.effects or NOT_ALL_TRIED in verdict.notes:
        return compared  # a search that was cut short tells another effect on another machine
    usual = {
        calibration.model.outputs[c].name: float(s)
        for c, s in zip(compared.rows.columns, calibration.usual.rms, strict=True)
    }
    # an instrument may have become noisier: such errors are no model's
    error = tuple(replace(c, noise=max(usual[c.output], c.noise)) for c in verdict.error if c.output in usual)
    if all(c.before <= ABOVE_USUAL * c.noise for c in error) or hardly_explained(error, ABOVE_USUAL, MOST):
        return compared
    if needs_to_suffice(verdict) and any(c.after > ABOVE_USUAL * c.noise for c in error):
        return compared
    if compared.verdict.word in WITH_A_NAME and not tells_more(compared.verdict, verdict):
        return compared
    after = fit_all_rows(found.model, compared.rows, None, calibration.constants, None)
    worse = _worse_on_reference(compared, found)
    if after is None or worse < -LEAST_GAIN / 2:
        return compared  # it can not be run, or the model lacks it on the reference as well
    return _told(compared, found, error, after, worse > LEAST_GAIN / 2)


def _worse_on_reference(compared: Comparison, found: Discovery) -> float:
    """How much the criterion of the reference is worse with the effects; infinite where all are of the record's time.

    Negative infinity where the reference can not be simulated with them: then nothing says that they are new.
    """
    if all(e.effect.driver == "time" for e in found.verdict.effects):
        return float("inf")
    calibration = compared.calibration
    there = fit_all_rows(found.model, calibration.rows, None, calibration.constants, None)
    if there is None:
        return float("-inf")
    return _loss(calibration.rows, there.fit.errors) - _loss(calibration.rows, calibration.fit.errors)


def with_constants_held(model: Model, names: tuple[str, ...]) -> Model:
    """The model with constants that are not fitted."""
    parameters = tuple(replace(p, role="fixed") if p.name in names else p for p in model.parameters)
    return replace(model, parameters=parameters)


def needs_to_suffice(found: Verdict) -> bool:
    """Whether what is told has no excuse for an error that is left: a free curve in time, or several effects.

    A curve bends to what any cause has done. A burst rate that follows the solids was told as one that fell, and air
    recovery kept 1.8 times its usual error. Several effects stand in for a third thing where something is left: a load
    that swings on a robot's arm was a class of its friction, its motor and its gear, two at a time.
    """
    return len(found.effects) > 1 or any(e.effect.driver == "time" and e.effect.family.is_curve for e in found.effects)


def tells_more(said: Verdict, found: Verdict) -> bool:
    """Whether errors are clearly smaller than with what is told, or one of a class is told and only noise is left.

    They are clearly smaller by their geometric mean, or where what is told leaves something missing and what is found
    does not. Where errors are the noise from row to row the model is right, and its likelihood may tell what errors do
    not.
    """
    if _left(found.error, found.error) <= BETTER * _left(said.error, found.error) or _ends_it(said.error, found.error):
        return True
    member = said.word == "class" and found.word == "named" and len(found.effects) == 1
    known = {(e.effect.site, e.effect.driver) for e in found.effects} <= set(said.members)
    return member and known and all(c.after <= AT_NOISE * c.noise for c in found.error)


def _ends_it(said: Sequence[OutputChange], found: Sequence[OutputChange]) -> bool:
    """Whether outputs that are above their usual error with what is told are not with what is found, nor any other."""
    level = {c.output: c.after for c in said}
    high = [c for c in found if level.get(c.output, 0.0) > ABOVE_USUAL * c.noise]
    ended = all(c.after <= BETTER * level[c.output] for c in high)
    return bool(high) and ended and all(c.after <= ABOVE_USUAL * c.noise for c in found)


def _told(
    compared: Comparison, found: Discovery, error: tuple[OutputChange, ...], after: Fitted, new: bool
) -> Comparison:
    verdict = found.verdict
    first = verdict.effects[0].effect
    hypothesis = Hypothesis(first.site, first.driver, SEARCHED, first, (), ({},))
    best = Tested(
        hypothesis,
        after.fit,
        after.fit.errors,
        compared.rows.losses(after.fit.errors),
        np.empty((0, 0)),
        0.0,
        np.empty(0),
    )
    word: Literal["named", "class"] = "named" if verdict.word == "named" else "class"
    kept = (n for n in verdict.notes if n != NONE_FITTED and not n.startswith(DOES_THE_SAME))
    verdict = replace(verdict, notes=tuple(kept))
    alone = f"By single faults of the whole record: {compared.verdict.reason}"
    told = Verdict(
        word=word,
        reason=since_reference(verdict.reason, new),
        effects=verdict.effects,
        members=verdict.members,
        error=error,
        split=REPORT_ROWS,
        report_times=verdict.report_times,
        parameters=compared.verdict.parameters,
        notes=(*what_is_left(error, reference=True), alone, *map(_sentence, verdict.notes)),
        seconds=compared.verdict.seconds + verdict.seconds,
    )
    return replace(
        compared,
        verdict=told,
        model=found.model.with_parameters(after.fit.values),
        judged=Judged(word, best, (), "", float("nan")),
    )


def _sentence(note: str) -> str:
    """A note with a capital letter and a full stop, like those of several records."""
    return f"{note[:1].upper()}{note[1:].rstrip('.')}."


def _loss(rows: Rows, errors: Sequence[FloatArray]) -> float:
    """Criterion of all rows that count."""
    return float(sum(loss.sum() for loss in rows.losses(errors)))


def _left(error: Sequence[OutputChange], noise: Sequence[OutputChange]) -> float:
    """Geometric mean over the outputs of the error after over the noise from row to row."""
    level = {c.output: c.noise for c in noise if c.noise > 0}
    left = [np.log(c.after / level[c.output]) for c in error if c.output in level and c.after > 0]
    return float(np.exp(np.mean(left))) if left else float("inf")
