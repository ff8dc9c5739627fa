"""What is told since a reference, and when it is taken back: it leaves too much, or another form contradicts it."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from adaptive_flot.discovery.hypotheses.joint.at_noise import are_noise
from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.hypotheses.procedure import Comparison
from adaptive_flot.discovery.hypotheses.telling import ABOVE_USUAL, FAR_ABOVE
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.results import Verdict
from adaptive_flot.discovery.results.words import WITH_A_NAME
from adaptive_flot.discovery.since_reference.searched_change import AT_NOISE
from adaptive_flot.greybox.effects import Effect

MUCH_LEFT = 4.0
"""An error so many times that of the reference, with what is told, is much: then it stands in for something else."""
ONE_CHANGE_LEFT = 2.5
"""The same of one change in time: nothing repeats it, and after it errors are those of the reference again. Of
twelve right names of other processes the most left 1.4 times. Coolant that came warmer, told as less, left 2.9."""


def leaves_more(verdict: Verdict) -> bool:
    """Whether something has changed that is not told, or what is told leaves an error above that of the reference."""
    left = any(c.after > ABOVE_USUAL * c.noise for c in verdict.error)
    return verdict.word == "abstain" or (verdict.word in WITH_A_NAME and left)


def unless_contradicted(compared: Comparison, told: Told) -> Comparison:
    """The comparison, its name taken back where the innovations form does not know it.

    That is where it leaves more than the reference and another part is named there, or far more and no explanation
    there has that effect. And it is where the errors are not far above those of the reference, and the best explanation
    there does not have it either: so little may be what wanders.
    """
    verdict, found = compared.verdict, told.effects
    sites = verdict.sites
    if verdict.word not in WITH_A_NAME or sites & {h.site for h in found}:
        return compared
    if told.word == "named" and found and leaves_more(verdict):
        said = " and ".join(h.label for h in found)
        why = f"it leaves more than the reference, and with process noise {said} explains more"
    elif not _known_by(told, verdict) and any(c.after > FAR_ABOVE * c.noise for c in verdict.error):
        why = "it leaves far more than the reference, and with process noise nothing speaks for it"
    elif all(c.before <= FAR_ABOVE * c.noise for c in verdict.error) and not _is_in(told.best, verdict):
        why = "errors are not far above those of the reference, and with process noise it is not confirmed"
        return taken_back(compared, why, said="No change is told")
    else:
        return compared
    return taken_back(compared, why)


def _known_by(told: Told, verdict: Verdict) -> bool:
    """Whether an explanation of the innovations form has one of the effects that are told."""
    return any(_is_in(e, verdict) for e in told.alike)


def _is_in(explanation: Explanation, verdict: Verdict) -> bool:
    """Whether an explanation has one of the effects that are told."""
    said = {(e.effect.site, e.effect.driver) for e in verdict.effects} | set(verdict.members)
    return bool(said & {(h.site, h.driver) for h in explanation.hypotheses})


def unless_much_is_left(compared: Comparison) -> Comparison:
    """The comparison, its name or class taken back where it stays far above the errors of the reference.

    A name by the output of which it leaves the most: another part may explain that, too. A class, which says less, by
    the geometric mean of after / usual over the outputs; but no output may be twice as far above as one of a name. That
    of one change in time must come nearer (ONE_CHANGE_LEFT). What comes and goes is confirmed at each of its times.
    """
    verdict = compared.verdict
    left = {c.output: c.after / c.noise for c in verdict.error if c.noise > 0 and c.after > 0}
    if verdict.word not in WITH_A_NAME or not left:
        return compared
    logs = np.log(list(left.values()))
    most_of_all = float(np.max(logs)) - (np.log(2.0) if verdict.word == "class" else 0.0)
    once = bool(verdict.effects) and all(_changes_once(e.effect) for e in verdict.effects)
    if max(most_of_all, float(np.mean(logs))) <= np.log(ONE_CHANGE_LEFT if once else MUCH_LEFT):
        return compared
    most = max(left, key=lambda name: left[name])
    why = f"with it the error of {most.replace('_', ' ')} is still {left[most]:.1f} times that of the reference"
    return taken_back(compared, f"{why}, so it may stand in for something else")


def _changes_once(effect: Effect) -> bool:
    """Whether an effect is one change in time, at once or gradually, and no spells."""
    return effect.driver == "time" and effect.settings.get("count", 1.0) == 1.0


def unless_more_than_noise(compared: Comparison) -> Comparison:
    """The comparison, its name or class taken back where the model is right on its reference, and not with the name.

    Where it errs by no more than noise there, the right name leaves no more in any output. Errors without a memory are
    noise, however large: a meter is noisier where more flows.
    """
    verdict = compared.verdict
    level = _noise_where_right(compared)
    left = {c.output: c.after / level[c.output] for c in verdict.error if c.output in level}
    if compared.judged.best is not None:
        noise = are_noise(compared.rows, compared.judged.best.fresh)
        outputs = compared.calibration.model.outputs
        at = {outputs[c].name for c, is_noise in zip(compared.rows.columns, noise, strict=True) if is_noise}
        left = {name: times for name, times in left.items() if name not in at}
    most = max(left, key=lambda name: left[name], default="")
    if verdict.word not in WITH_A_NAME or not most or left[most] <= FAR_ABOVE:
        return compared
    why = f"with it the error of {most.replace('_', ' ')} is still {left[most]:.1f} times its noise"
    return taken_back(compared, f"{why}, which is all that the model errs by on the reference")


def _noise_where_right(compared: Comparison) -> dict[str, float]:
    """Noise from row to row of each output in the new records and the reference; none where the model errs by more."""
    calibration, columns = compared.calibration, compared.rows.columns
    if (calibration.usual.overall > AT_NOISE * calibration.noise).any():
        return {}
    level = np.maximum(noise_floor(compared.rows.records, columns), calibration.usual.overall)
    return {calibration.model.outputs[c].name: float(s) for c, s in zip(columns, level, strict=True)}


def taken_back(
    compared: Comparison, why: str, differs: str = "differs from the reference", said: str = ""
) -> Comparison:
    """The comparison without its name, and why."""
    word: Literal["abstain"] = "abstain"
    verdict = compared.verdict
    nearest = verdict.reason[:1].lower() + verdict.reason[1:]
    said = said or f"Something {differs}, and it is not told what"
    reason = f"{said}: {why}. The nearest: {nearest}"
    return replace(
        compared,
        verdict=replace(verdict, word=word, reason=reason, effects=(), members=()),
        judged=replace(compared.judged, word=word),
        model=compared.calibration.model,
    )
