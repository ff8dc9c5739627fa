"""Exchange: the earlier effects of a set are searched again, with the later ones in place.

The first effect of several is chosen while the others are missing. It is then the one that makes up best for them, and
the true one may not even be among those that were extended. So each earlier effect is taken out, and whatever scores
best in its place is refitted (a stepwise search that goes both ways: Efroymson, *Multiple regression analysis*, 1960).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.results import Alternative, Round
from adaptive_flot.discovery.search.rounds import ranked, run_round, scorer_of
from adaptive_flot.discovery.search.simplify import refitted

EXCHANGED = 8
"""Candidates that are refitted in the place of one."""


def with_exchanges(
    fitter: Fitter,
    base: Fit,
    latest: Round,
    processes: int = 1,
    progress: Callable[[str], None] = lambda stage: None,
) -> Round:
    """The round, with the sets in which something else stands in the place of an earlier effect of its best set.

    Parameters
    ----------
    fitter, base
        The fitter of the record, and the fit of the model as it is.
    latest
        The round; its best set has several effects, or nothing is to be exchanged.
    processes, progress
        As in `search`.
    """
    problem, best = fitter.problem, latest.alternatives[0]
    found, compared = [*latest.alternatives], latest.compared
    for k in range(len(best.names) - 1):
        if problem.time_is_up:
            break
        rest = without(fitter, base, best, k)
        if rest is None:
            continue
        progress("what else it may be")
        scorer, _ = scorer_of(problem, rest.fit)
        again = run_round(fitter, base, [scorer], [rest], processes, progress, EXCHANGED)
        found += again.alternatives
        compared = compared and again.compared
    return replace(latest, alternatives=ranked(problem, base, found), compared=compared)


def without(fitter: Fitter, base: Fit, a: Alternative, k: int) -> Alternative | None:
    """The alternative without its effect number k, fitted from where it stands; None when that can not be."""
    fit = refitted(fitter, base, a, [replace(e, coefficients={}) for i, e in enumerate(a.effects) if i != k])
    if fit is None:
        return None
    names, known = ((*values[:k], *values[k + 1 :]) for values in (a.names, a.known))
    return Alternative(names, known, fit, base.loss - fit.loss, fit.bic - base.bic)
