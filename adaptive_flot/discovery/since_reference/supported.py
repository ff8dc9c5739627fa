"""Whether the innovations form has any use for what free runs tell, and tells it from other parts.

Over hours a free run adds up whatever is not quite balanced. Where nothing depends on the level of a vessel, a gauge
that drifts, a wandering supply and a pump that is worn all look alike there. With process noise each row counts, and a
pump that is worn shows whenever it is moved. Where that brings nothing, the free runs have named what happened to fit.
"""

from __future__ import annotations

from collections.abc import Set

import numpy as np

from adaptive_flot.discovery.hypotheses.cross_validation import Tested, model_with
from adaptive_flot.discovery.hypotheses.families import EVENTS, STRUCTURE
from adaptive_flot.discovery.hypotheses.procedure import Comparison
from adaptive_flot.discovery.hypotheses.telling import FAR_ABOVE
from adaptive_flot.discovery.innovations.search.explanation import LEAST_GAIN, Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.results.words import WITH_A_NAME
from adaptive_flot.discovery.since_reference.taken_back import leaves_more, taken_back

LATE = "lag"
SMALL_SHARE = 0.5
"""Share of the gain of the best explanation with process noise, which has another part, below which a name is none. A
healthy pipeline at another load was a class of two valves at their limits, which gained 357 of 978."""
SUPPORT = 40.0
"""Gain of the criterion that speaks for a name. Of 17 right ones of other processes the least gained 49. Gauges that
drift, and wandering alone, have given wrong ones up to 30."""


def unless_unsupported(compared: Comparison, search: Search, base: Explanation, told: Told) -> Comparison:
    """The comparison, its name or class taken back where with process noise none of it gains SUPPORT, or a fair share.

    Also where it leaves more than the reference, and with process noise one part elsewhere alone explains surely more.

    Parameters
    ----------
    compared
        The comparison of free runs.
    search, base, told
        The search in innovations form, the model as it is there, and what was judged.
    """
    verdict, best = compared.verdict, compared.judged.best
    if verdict.word not in WITH_A_NAME or best is None:
        return compared
    sites = verdict.sites
    pairs = {(e.effect.site, e.effect.driver) for e in verdict.effects} | set(verdict.members)
    if any(e.criterion - base.criterion > SUPPORT and _speaks_for(e, sites, pairs) for e in told.alike):
        return compared
    # each form is asked: what starts where a free run has it may rest there, as a limit that nothing reaches
    gain = max(_gain(search, base, each) for each in (best, *compared.judged.alike))
    most = told.best.criterion - base.criterion
    if gain > max(SUPPORT, SMALL_SHARE * most):
        better = [e for e in told.alike if _is_elsewhere(e, sites) and e.criterion - base.criterion > gain + LEAST_GAIN]
        if not better or not leaves_more(verdict):  # what leaves nothing else to explain needs no other part
            return compared
        return taken_back(compared, f"with process noise {better[0].hypotheses[0].label} explains more")
    why = "with process noise too little speaks for it, so that whatever drifts or wanders may be behind it"
    if gain > SUPPORT:
        said = " and ".join(h.label for h in told.best.hypotheses)
        why = f"with process noise {said} explains far more"
    return taken_back(compared, why)


def _speaks_for(e: Explanation, sites: frozenset[str], said: Set[tuple[str, str]]) -> bool:
    """Whether an explanation has what is told at its site, a change that is there all the time.

    An event there, or a part that is late, is another cause. So is a dependence of that part, unless it is what is
    told: an evaporator at another load has a heater that depends on the load, and not one that has become better.
    """
    lasting = [h for h in e.hypotheses if h.site in sites and h.kind not in (*EVENTS, LATE)]
    return any(h.kind not in STRUCTURE or (h.site, h.driver) in said for h in lasting)


def _is_elsewhere(e: Explanation, sites: frozenset[str]) -> bool:
    """Whether an explanation is one part alone, at another site, that is off all the time."""
    if len(e.hypotheses) != 1:  # the model as it is has none
        return False
    (h,) = e.hypotheses
    return h.site not in sites and h.kind not in (*EVENTS, *STRUCTURE, LATE)


def _wanders(compared: Comparison) -> bool:
    """Whether an error of the reference is far above its noise from row to row."""
    calibration = compared.calibration
    return bool((calibration.usual.overall > FAR_ABOVE * calibration.noise).any())


def _gain(search: Search, base: Explanation, tested: Tested) -> float:
    """Gain of the criterion by a hypothesis, fitted from where free runs have it; infinite where it has no fit."""
    h = tested.hypothesis
    if h is None:
        return float("inf")
    model = model_with(search.model, h)
    there, own = (list(m.indices("parameters", search.free)) for m in (model, search.model))
    p = model.parameter_values
    p[list(model.indices("parameters", h.parameters))] = [tested.fit.value(name) for name in h.parameters]
    p[there] = base.fit.p[own]
    gain = search.added(base, h, p).criterion - base.criterion
    return gain if np.isfinite(gain) else float("inf")


def unless_alike(compared: Comparison, told: Told) -> Comparison:
    """The comparison, its name or class taken back where with process noise a part that it leaves out is as good.

    Free runs over hours tell parts apart by what wanders as well. Where the errors of the reference are far more than
    noise, the innovations form must tell a part that is named from others, too. One effect of another site that is
    there all the time, and that it does not tell from it by LEAST_GAIN, is a member that the class lacks.

    Parameters
    ----------
    compared
        The comparison of free runs.
    told
        What the innovations form has judged.
    """
    verdict = compared.verdict
    if verdict.word not in WITH_A_NAME or not _wanders(compared):
        return compared
    sites = verdict.sites
    single = [(e.hypotheses[0], e.criterion) for e in told.alike if len(e.hypotheses) == 1]
    lasting = [(h, c) for h, c in single if h.kind not in (*EVENTS, *STRUCTURE, LATE)]
    own = max((c for h, c in lasting if h.site in sites), default=float("inf"))
    others = [h for h, c in lasting if h.site not in sites and c > own - LEAST_GAIN]
    if not others:
        return compared
    said = ", ".join(h.label for h in others)
    return taken_back(compared, f"with process noise {said} explains about as much")
