"""Events that are there in the last rows that were fitted: none of these has seen an end."""

from __future__ import annotations

import numpy as np

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.greybox.forms.form import CoefficientRole, number

EDGES = 2.0
"""Rows, and widths of its edges, before the last fitted row from which an event counts as there in that."""


def with_unseen_ends(fitter: Fitter, fit: Fit) -> Fit:
    """The fit, its events that are there in the last fitted row held to the end of the record, and no time of an end.

    An analyser that stayed 12 % low was told to be right again from the first row on that nobody had fitted.
    """
    time, dt = fitter.problem.record.time, fitter.problem.record.dt
    last = float(time[np.flatnonzero(fitter.rows)[-1]])
    held = {}
    for effect in fit.model.fitted_effects():
        begins, lasts = (effect.names(role) for role in (CoefficientRole.ONSET, CoefficientRole.DURATION))
        if not effect.family.passes or len(begins) != len(lasts):
            continue
        settings = effect.full_settings
        width = number(settings, "width") if "width" in settings else 0.0
        for begin, long in zip(begins, lasts, strict=True):
            onset, end = effect.coefficients[begin], effect.coefficients[begin] + effect.coefficients[long]
            if last - EDGES * (dt + width) <= end < time[-1] and effect.parameter(long) in fit.names:
                held[effect.parameter(long)] = float(time[-1] - onset + EDGES * (dt + width))
    if not held:
        return fit
    names = tuple(name for name in fit.names if name not in held)
    return fitter.fit(fit.model.with_parameters(held), names, held, fit, rounds=2) or fit
