"""The verdict on an event that the innovations form has found in a record with a reference."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.innovations.in_words import told_in_words, words_at
from adaptive_flot.discovery.innovations.judge import Told
from adaptive_flot.discovery.innovations.search import Explanation, Search
from adaptive_flot.discovery.results import NamedEffect, OutputChange, Verdict
from adaptive_flot.greybox.filtering import prediction_errors
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.stepper import Stepper

AHEAD = 20
"""Rows that the errors of the verdict are predicted ahead, at most."""
JUDGED_ON = f"predictions up to {AHEAD} rows ahead"


def event_verdict(verdict: Verdict, search: Search, base: Explanation, told: Told) -> Verdict:
    """Tell an event instead of what the whole record was compared for.

    Parameters
    ----------
    verdict
        What the comparison of the whole record says; its notes stay.
    search, base, told
        The search in innovations form, the model as it is, and what was judged.
    """
    before, after = (_ahead(search, e) for e in (base, told.best))
    outputs = [search.model.outputs[c] for c in search.columns]
    error = tuple(
        OutputChange(q.name, q.unit, float(b), float(a), float(n), (float("nan"), float("nan")))
        for q, b, a, n in zip(outputs, before, after, search.floor, strict=True)
    )
    model = search.model_of(told.best)
    said = told.certain or tuple(h for _, h in told.open[:1])
    fitted = {e.label: e for e in model.fitted_effects()}
    effects = tuple(NamedEffect(fitted[h.effect.label], words_at(search, told.best, h), {}, ()) for h in said)
    helped = ", ".join(f"{c.output} {c.before:.3g} -> {c.after:.3g} {c.unit}".rstrip(" -") for c in error)
    return replace(
        verdict,
        word=told.word,
        reason=f"{told_in_words(search, told)} Error up to {AHEAD} rows ahead: {helped}.",
        effects=effects,
        members=tuple((h.site, h.driver) for _, h in told.open) if told.word == "class" else (),
        error=error,
        split=JUDGED_ON,
        notes=(*verdict.notes, f"Over the whole record: {verdict.reason}"),
    )


def _ahead(search: Search, explanation: Explanation) -> FloatArray:
    """Root mean square error of each output up to AHEAD rows ahead of the filter (m,)."""
    model, fit = search.model_of(explanation), explanation.fit
    stepper = Stepper(model, search.record.dt)
    errors = prediction_errors(stepper, search.record, fit.filtered, search.columns, (), fit.p, AHEAD)
    rms: FloatArray = np.sqrt(np.nanmean(errors**2, axis=0))
    return rms
