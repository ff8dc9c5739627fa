"""The verdict: word, first sentence, effects with intervals, errors before and after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from adaptive_flot.discovery.hypotheses.calibration import Calibration
from adaptive_flot.discovery.hypotheses.comparison import Blocks, reduction, rms
from adaptive_flot.discovery.hypotheses.cross_validation import Tested, model_with
from adaptive_flot.discovery.hypotheses.joint.at_noise import JUST_ABOVE, are_noise, are_usual
from adaptive_flot.discovery.hypotheses.joint.rows import Rows, noise_floor
from adaptive_flot.discovery.hypotheses.judgement import USUAL, Judged
from adaptive_flot.discovery.hypotheses.wording import words_of
from adaptive_flot.discovery.record.robust import AT_NOISE
from adaptive_flot.discovery.record.slip_jump import band_ranges
from adaptive_flot.discovery.results import NamedEffect, OutputChange, Verdict
from adaptive_flot.discovery.results.words import NO_SITE, NORMAL95, WITH_A_NAME, rough
from adaptive_flot.greybox.model import Model

ABOVE_NOISE, ABOVE_USUAL = 3.0, 1.5
"""An error so many times the noise from row to row, or that of the reference, says that more is missing."""
LARGER = 1.3
"""Errors so many times those of the reference are no longer called the same."""
FAR_ABOVE = 2.0
"""An error so many times its usual one is far above it."""
FEWEST_REPEATED, REPEATED = 30, 0.1
"""An output that shows one value for so many rows, and for such a share of them, may have stopped."""
SEEN, WIDER, BEYOND = (0.002, 0.998), 0.05, 0.05
"""Quantiles that a reference covers, wider by a share of their distance; and the share of rows beyond that counts."""
AT_AN_END = 1e-3
"""Share of its value by which a constant may lie off the end of its range, and is still at it."""
MOVED = 1.0
"""A constant is said to have moved from so many of its standard deviations on."""
JUDGED_ON = "free run, fresh stretches"


def unless_at_noise(judged: Judged, rows: Rows, null: Tested, reference: Calibration | None) -> Judged:
    """The judgement: `none` where no hypothesis stands, and errors are the noise from row to row of these records.

    Or where they are those of the reference, but for outliers. Else it would be said that something is missing where
    nothing is left to explain. An instrument may have become noisier, see `without_memory`.
    """
    if judged.word != "abstain" or judged.best is not None:
        return judged
    above = rms(rows, null.fresh) > AT_NOISE * noise_floor(rows.records, rows.columns)
    if not (above & ~are_noise(rows, null.fresh)).any():
        return replace(judged, word="none", why="their errors are those of the noise from row to row")
    if reference and are_usual(rows, null.fresh, reference.rows, reference.fit.errors).all():
        return replace(
            judged, word="none", why="but for single values far off, their errors are those of the reference"
        )
    return judged


def verdict_of(
    calibration: Calibration,
    rows: Rows,
    blocks: Blocks,
    null: Tested,
    judged: Judged,
    reference: bool,
    seconds: float,
) -> Verdict:
    """Return what to tell: `reference` says whether there was one, `seconds` how long it took."""
    model = calibration.model
    told = judged.word in WITH_A_NAME
    after = judged.best if judged.best is not None else null
    old, new = rms(rows, null.fresh), rms(rows, after.fresh)
    error = tuple(
        OutputChange(
            model.outputs[c].name, model.outputs[c].unit, float(old[j]), float(new[j]),
            float((calibration.usual.rms if reference else calibration.noise)[j]),
            (r.low, r.high),
        )
        for j, c in enumerate(rows.columns)
        for r in [reduction(blocks, j, null.fresh, after.fresh)]
    )  # fmt: skip
    effects = _effects(model, judged, rows) if told else ()
    noise = are_noise(rows, after.fresh) if told else [True] * len(error)
    more = [c for c, is_noise in zip(error, noise, strict=True) if not is_noise]
    members = tuple((t.hypothesis.site, t.hypothesis.driver) for t in judged.parts if t.hypothesis)
    members += ((judged.beside.place, judged.beside.driver),) if told and judged.beside else ()
    word = "class" if judged.word == "named" and judged.beside else judged.word
    fitted = model.indices("parameters", calibration.constants.names)
    labels = {model.parameters[i].label: model.parameters[i].value for i in fitted}
    return Verdict(
        word=word,
        reason=_reason(model, judged, reference, error),
        effects=effects,
        members=members if word == "class" else (),
        error=error,
        split=JUDGED_ON,
        parameters=labels,
        notes=(
            *_stopped(model, rows),
            *what_is_left(more, reference),
            *(_moved(calibration, after) if reference else ()),
            *(_beyond(calibration, rows, null) if reference and word == "abstain" else ()),
            *(_open_sizes(calibration, model, judged) if reference and told else ()),
        ),
        seconds=seconds,
    )


def _stopped(model: Model, rows: Rows) -> tuple[str, ...]:
    """Outputs that show the same value for long: no process is so still."""
    notes = []
    for record in rows.records:
        for c in rows.columns:
            values = record.outputs[:, c][np.isfinite(record.outputs[:, c])]
            longest = max((len(list(run)) for _, run in groupby(values)), default=0)
            if longest > max(FEWEST_REPEATED, REPEATED * len(values)):
                name = model.outputs[c].name.replace("_", " ")
                notes.append(
                    f"{record.name}: {name} shows the same value in {longest} rows on end; its sensor may have stopped."
                )
    return tuple(notes)


def _moved(calibration: Calibration, after: Tested) -> tuple[str, ...]:
    """Constants with which the new records are fitted, and which are far from those of the reference."""
    constants, model = calibration.constants, calibration.model
    std = np.sqrt(np.sum(constants.root**2, axis=1))
    label = {p.name: p.label for p in model.parameters}
    moved = [
        f"{label[n]} {after.fit.value(n):.6g} instead of {mean:.6g} +- {s:.2g}"
        for n, mean, s in zip(constants.names, constants.mean, std, strict=True)
        if abs(after.fit.value(n) - mean) > MOVED * s
    ]
    if not moved:
        return ()
    return (f"The new records are fitted with other constants than the reference: {', '.join(moved)}.",)


def _beyond(calibration: Calibration, rows: Rows, null: Tested) -> tuple[str, ...]:
    """Where the plant is beyond all that the reference has shown, in a share of the new rows.

    By its inputs; and by its outputs, both as measured and as the model has them. A gauge that is off brings no plant
    anywhere, and a free run that leaves the plant is no plant.
    """
    model, columns = calibration.model, list(rows.columns)
    names = [q.name.replace("_", " ") for q in (*model.inputs, *(model.outputs[c] for c in columns))]
    old = np.concatenate([np.hstack([r.inputs, r.outputs[:, columns]]) for r in calibration.rows.records])
    seen = np.concatenate([np.hstack([r.inputs, r.outputs[:, columns]]) for r in rows.records])
    had = np.concatenate(
        [np.hstack([r.inputs, r.outputs[:, columns] - e]) for r, e in zip(rows.records, null.fresh, strict=True)]
    )
    notes = []
    for name, was, both in zip(names, old.T, np.stack([seen, had], axis=-1).transpose(1, 0, 2), strict=True):
        was, now = was[np.isfinite(was)], both[np.isfinite(both).all(axis=1)]
        if not len(was) or not len(now):
            continue
        low, high = np.quantile(was, SEEN)
        apart = WIDER * (high - low)
        above, below = now.min(axis=1) > high + apart, now.max(axis=1) < low - apart
        for share, where in ((np.mean(above), "higher"), (np.mean(below), "lower")):
            if share > BEYOND:
                notes.append(f"{name} is {where} in {100 * share:.0f} % of the rows than in the reference")
    if not notes:
        return ()
    return (f"The model was never compared with the plant there: {'; '.join(notes)}.",)


def _open_sizes(calibration: Calibration, model: Model, judged: Judged) -> tuple[str, ...]:
    """Why a size that is told in the unit of a part may be off; a sensor's size is in the unit of what is measured.

    The reference tells some constants up to a factor only. Or one has ended where its range does, and holds those that
    act with it.
    """
    label = {p.name: p.label for p in model.parameters}
    loose = [label[name] for name in calibration.constants.up_to_a_factor()]
    sensors = {site.name for site in model.sites if site.role == "sensor"}
    modes = {site.name: site.mode for site in model.sites}
    told = (t.hypothesis for t in judged.parts if t.hypothesis is not None)
    if not any(h.site not in sensors and h.has_size_in_unit(modes[h.site]) for h in told):
        return ()
    notes = []
    if loose:
        notes.append(
            f"The reference tells these constants only up to a factor: {', '.join(loose)}. Sizes in the unit of a part "
            "may be off by as much; shares and times are not."
        )
    for p in (model.parameters[i] for i in model.indices("parameters", calibration.constants.names)):
        if end := p.end_at(p.value, AT_AN_END):
            notes.append(
                f"With the reference {p.label} is fitted at the {end} end of its range, {p.value:g}. Sizes in the unit "
                "of a part may be off; widen the range, or hold a constant fixed that acts with it."
            )
    return tuple(notes)


def what_is_left(error: Sequence[OutputChange], reference: bool) -> tuple[str, ...]:
    """What stays open: errors that are still above those of the reference, or far above the noise from row to row."""
    factor = ABOVE_USUAL if reference else ABOVE_NOISE
    left = [f"{c.output} {c.after / c.noise:.3g} times" for c in error if c.after > factor * c.noise]
    if not left:
        return ()
    than = "that of the reference" if reference else "the noise from row to row"
    return (f"More is missing: the error that is left is still above {than}: {', '.join(left)}.",)


def _effects(model: Model, judged: Judged, rows: Rows) -> tuple[NamedEffect, ...]:
    best = judged.best
    assert best is not None and best.hypothesis is not None  # a verdict that tells has a best hypothesis
    fitted = model_with(model, best.hypothesis).with_parameters(best.fit.values)
    effect = fitted.fitted_effects()[-1]
    interval = {
        c: (effect.coefficients[c] - NORMAL95 * float(s), effect.coefficients[c] + NORMAL95 * float(s))
        for c, s in zip(best.hypothesis.free, best.spread, strict=True)
    }
    interval |= band_ranges(fitted, effect, rows.records, best.fit.initial)
    others = tuple(
        (t.hypothesis.site, t.hypothesis.driver, t.total - best.total, float("nan"))
        for t in judged.alike
        if t.hypothesis is not None
    )
    return (NamedEffect(effect, words_of(model, best.hypothesis, best.fit.value), interval, others),)


def _reason(model: Model, judged: Judged, reference: bool, error: Sequence[OutputChange]) -> str:
    changed = "has changed" if reference else "is missing"
    most = max((c.before / c.noise for c in error if c.noise > 0), default=np.inf)
    if judged.word == "none":
        larger = (
            f"its errors are up to {rough(most)} times those of the reference, which vary as much between stretches"
        )
        why = larger if judged.why == USUAL and LARGER < most < np.inf else judged.why
        return f"Nothing {changed} that these records show: {why}."
    if judged.word == "insufficient":
        return f"The records do not say enough: {judged.why}."
    if judged.word == "abstain":
        differs = "differs from the reference" if reference else "is missing"
        near = ", ".join(t.hypothesis.label for t in judged.parts[:4] if t.hypothesis) or "nothing"
        if NO_SITE in judged.why:
            return f"Something {differs}, {judged.why}. Nearest at a site: {near}."
        if reference and most <= FAR_ABOVE:
            larger = f"up to {rough(most)} times those of the reference"
            size = larger if most > JUST_ABOVE else "no larger than those of the reference, but unlike them"
            first = f"Errors are {size}, and the records do not say why"
            return f"{first}: {judged.why}. What wanders in the process may do that. Nearest: {near}."
        return f"Something {differs}, but the records do not say what: {judged.why}. Nearest: {near}."
    said = [_part_in_words(model, judged, t) for t in judged.parts]
    said += [f"as if {judged.beside.words}, and {NO_SITE}"] if judged.beside else []
    first = f"{said[0][0].upper()}{said[0][1:]}." if len(said) == 1 else _one_of(said)
    helped = ", ".join(c.words for c in error)
    return f"{first} Error on stretches that did not fit it: {helped}."


def _part_in_words(model: Model, judged: Judged, best: Tested) -> str:
    """The best hypothesis at a part, and in brackets the others there that are not told from it."""
    assert best.hypothesis is not None  # the model as it is has no part
    same = [t for t in judged.alike if t is not best and t.hypothesis and t.hypothesis.site == best.hypothesis.site]
    site = best.hypothesis.site.replace("_", " ")
    others = [words_of(model, t.hypothesis, t.fit.value).removeprefix(f"{site} ") for t in same if t.hypothesis]
    return words_of(model, best.hypothesis, best.fit.value) + (f" (or {', or '.join(others)})" if others else "")


def _one_of(said: Sequence[str]) -> str:
    return f"One of these, which the records can not tell apart: {'; or '.join(said)}."
