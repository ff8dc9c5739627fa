"""Whether an event begins at another time than its fit has come to: the cost of an onset has many side minima."""

from __future__ import annotations

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.greybox.forms.form import CoefficientRole

SHIFTS = (0.01, 0.02, 0.04, 0.08)
"""Shares of the record by which an onset is moved, either way."""
BETTER = 10.0
"""Least drop of minus two log-likelihood for which another onset is taken."""
MOST_WORK = 12_000
"""Rows times states up to which this is tried: eight fits more."""


def with_onset_sought(fitter: Fitter, fit: Fit) -> Fit:
    """The fit, or a better one of those that start with the onset of its event moved.

    A friction acts while something moves: a step of it at 48 s was told at 45.5 s, within 0.04 s. Only for one event,
    and for a record that is short.
    """
    time = fitter.problem.record.time
    onsets = [e.parameter(n) for e in fit.model.fitted_effects() for n in e.names(CoefficientRole.ONSET)]
    free = [name for name in onsets if name in fit.names]
    if len(free) != 1 or len(time) * len(fit.model.states) > MOST_WORK:
        return fit
    (name,) = free
    span, now = float(time[-1] - time[0]), dict(zip(fit.names, fit.values, strict=True))[name]
    moved = [now + side * share * span for share in SHIFTS for side in (-1.0, 1.0)]
    tried = [fitter.fit(fit.model, fit.names, {name: t}, fit, rounds=2) for t in moved if time[0] < t < time[-1]]
    best = min((f for f in tried if f is not None), key=lambda f: f.loss, default=fit)
    return best if best.loss < fit.loss - BETTER else fit
