"""Lags of all inputs look like lags of all outputs: the set at the other end is fitted beside the best one.

In a linear plant lags commute. A search that adds one effect after the other, and exchanges one at a time, comes to one
of the two sets by chance, and to the other one never, or by lags of more numbers than it needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Alternative, SearchResult
from adaptive_flot.discovery.search.alternatives import effect_bounds, fixed_coefficients
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.forms.form import CoefficientRole
from adaptive_flot.greybox.model import Model

MOST_SITES = 4
"""Sites at the other end up to which a set is mirrored."""
NEAR = 1.0
"""A set that the search has come to, and that is worse by less, is not fitted again."""
OTHER_END = {"actuator": "sensor", "sensor": "actuator"}


def with_mirrored_lags(problem: Problem, result: SearchResult) -> SearchResult:
    """The search with the mirrored set among its alternatives, where the best one has several lags at one end.

    Each site of the other end then has a lag, of the mean time constant to start from; other effects stay as they are.
    """
    best = result.alternatives[0] if result.alternatives else None
    if best is None or problem.background is not None or best.adjusted_bic is not None or problem.time_is_up:
        return result
    model = result.base.model
    roles = {s.name: s.role for s in model.sites}
    late = [e for e in best.effects if e.driver == "lag" and e.names(CoefficientRole.TIME_CONSTANT)]
    ends = {roles[e.site] for e in late}
    if len(late) < 2 or len(ends) != 1 or not ends <= set(OTHER_END):
        return result
    there = _sites_of(model, problem, OTHER_END[ends.pop()])
    names = tuple((site, "lag") for site in there)
    others = [k for k, e in enumerate(best.effects) if e not in late]
    wanted = frozenset((*names, *(best.names[k] for k in others)))
    same = next((a for a in result.alternatives if frozenset(a.names) == wanted), None)
    if not 2 <= len(there) <= MOST_SITES or (same is not None and same.fit.bic < best.fit.bic + NEAR):
        return result
    tau = float(np.mean([t for e in late for t in e.values(CoefficientRole.TIME_CONSTANT)[:1]]))
    lags = [Effect(site, "lag", "lag", {}, {"scale": problem.site_sizes.get(site) or 1.0}) for site in there]
    fit = _fitted(problem, result.base, best, [best.effects[k] for k in others], lags, tau)
    if fit is None:
        return result
    known = (*(best.known[k] for k in others), *(True for _ in there))
    mirrored = Alternative(
        (*(best.names[k] for k in others), *names), known, fit, result.base.loss - fit.loss, fit.bic - result.base.bic
    )
    if same is not None and same.fit.bic < mirrored.fit.bic:
        return result
    ranked = sorted([*(a for a in result.alternatives if a is not same), mirrored], key=lambda a: a.fit.bic)
    return replace(result, alternatives=tuple(ranked))


def _sites_of(model: Model, problem: Problem, role: str) -> list[str]:
    """Sites of a role that a lag may stand at."""
    return [s.name for s in model.sites if s.role == role and s.passed == 1 and problem.site_sizes.get(s.name, 1.0) > 0]


def _fitted(
    problem: Problem, base: Fit, best: Alternative, others: Sequence[Effect], lags: Sequence[Effect], tau: float
) -> Fit | None:
    """Fit of the effects that stay and of lags, from the best alternative; None where it can not be run."""
    effects = [replace(e, coefficients=fixed_coefficients(e)) for e in (*others, *lags)]
    model = base.model.with_effects(effects)
    free, bounds, start = [*base.names], dict[str, tuple[float, float]](), dict[str, float]()
    for e in effects:
        free += [e.parameter(c.name) for c in e.terms if c.name not in e.coefficients]
        bounds |= effect_bounds(problem, model, e)
    for e in effects[len(others) :]:
        start |= {e.parameter(name): tau for name in e.names(CoefficientRole.TIME_CONSTANT)}
    fitter = Fitter(problem)
    fit = fitter.fit(model, tuple(free), start, best.fit, bounds, rounds=2)
    return None if fit is None else fitter.settled(fit, bounds)
