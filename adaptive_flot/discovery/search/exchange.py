"""Exchange: each effect of a set is searched again, with all the others in place.

The first effect of several is chosen while the others are missing. It is then the one that makes up best for them, and
the true one may not even be among those that were extended. So each effect is taken out, and whatever scores best in
its place is refitted (a stepwise search that goes both ways: Efroymson, *Multiple regression analysis*, 1960). Once the
best set has changed, its other effects were chosen beside what has gone: they are searched again too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.results import Alternative, Round
from adaptive_flot.discovery.search.rounds import ranked, run_round, scorer_of
from adaptive_flot.discovery.search.simplify import refitted

EXCHANGED = 8
"""Candidates that are refitted in the place of one."""
MOST_EXCHANGES = 2
"""Searches for each effect of a set, on average: the sets hardly change after that."""


def with_exchanges(
    fitter: Fitter,
    base: Fit,
    latest: Round,
    extended: Sequence[Alternative | None],
    processes: int = 1,
    progress: Callable[[str], None] = lambda stage: None,
) -> Round:
    """The round, with the sets in which something else stands in the place of an effect of its best set.

    Parameters
    ----------
    fitter, base
        The fitter of the record, and the fit of the model as it is.
    latest
        The round; its best set has several effects, or nothing is to be exchanged.
    extended
        What the round has extended: beside these, all that could follow was searched.
    processes, progress
        As in `search`.
    """
    problem = fitter.problem
    searched = {frozenset(a.names) for a in extended if a is not None}
    for _ in range(MOST_EXCHANGES * len(latest.alternatives[0].names)):
        best = latest.alternatives[0]
        k = next((k for k in range(len(best.names)) if _rest(best, k) not in searched), None)
        if k is None or len(best.names) < 2 or problem.time_is_up:
            break
        searched.add(_rest(best, k))
        rest = without(fitter, base, best, k)
        if rest is None:
            continue
        progress("what else it may be")
        scorer, _ = scorer_of(problem, rest.fit)
        again = run_round(fitter, base, [scorer], [rest], processes, progress, EXCHANGED, best)
        alternatives = ranked(problem, base, [*latest.alternatives, *again.alternatives])
        latest = replace(latest, alternatives=alternatives, compared=latest.compared and again.compared)
    return latest


def _rest(a: Alternative, k: int) -> frozenset[tuple[str, str]]:
    """Names of the alternative without its effect number k."""
    return frozenset((*a.names[:k], *a.names[k + 1 :]))


def without(fitter: Fitter, base: Fit, a: Alternative, k: int) -> Alternative | None:
    """The alternative without its effect number k, fitted from where it stands; None when that can not be."""
    fit = refitted(fitter, base, a, [replace(e, coefficients={}) for i, e in enumerate(a.effects) if i != k])
    if fit is None:
        return None
    names, known = ((*values[:k], *values[k + 1 :]) for values in (a.names, a.known))
    return Alternative(names, known, fit, base.loss - fit.loss, fit.bic - base.bic)
