"""A dependence that a second effect has made flat: tried again as the constant that it came to.

The first effect of several is chosen while the others are missing, and bends to make up for them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.results import Alternative
from adaptive_flot.discovery.search.alternatives import effect_bounds, fixed_coefficients, limited
from adaptive_flot.greybox.effects import STATELESS_DRIVERS, Effect


def simpler(fitter: Fitter, base: Fit, a: Alternative) -> list[Alternative]:
    """The alternative with one dependence on a signal, in turn each, replaced by a constant at the same site.

    Left out is what would name a constant twice, what adapted parameters take up, and what can not be simulated.
    """
    alternatives, modes = [], {s.name: s.mode for s in base.model.sites}
    for k, effect in enumerate(a.effects):
        constant = (effect.site, "constant")
        if effect.driver in STATELESS_DRIVERS or constant in a.names or effect.family.static is None:
            continue
        if (effect.site, effect.mode or modes[effect.site]) in fitter.problem.absorbed:
            continue
        others = [replace(e, coefficients={}) for i, e in enumerate(a.effects) if i != k]
        shift = Effect(effect.site, "constant", "shift", mode=effect.mode)
        fit = refitted(fitter, base, a, [*others[:k], shift, *others[k:]], _middle(effect))
        if fit is not None:
            names = (*a.names[:k], constant, *a.names[k + 1 :])
            known = (*a.known[:k], True, *a.known[k + 1 :])
            alternatives.append(Alternative(names, known, fit, base.loss - fit.loss, fit.bic - base.bic))
    return alternatives


def _middle(effect: Effect) -> float:
    """The constant that a dependence comes to: the mean of its values, or its amplitude."""
    return float(np.mean(effect.levels)) if effect.levels else 0.0


def refitted(
    fitter: Fitter, base: Fit, a: Alternative, effects: list[Effect], middle: float = 0.0, *, near: bool = False
) -> Fit | None:
    """Fit of other effects, from where those that an alternative has as well stand in it; None when that can not be.

    A constant that it does not have starts at `middle`. Where all else is as it was, the fit stays `near` that: it
    begins with the same noise model. By large white noise it may come to rest elsewhere, far worse.
    """
    held = [fixed_coefficients(e) for e in effects]
    model = base.model.with_effects([replace(e, coefficients=h) for e, h in zip(effects, held, strict=True)])
    free = [*base.names]
    start: dict[str, float] = {}
    bounds: dict[str, tuple[float, float]] = {}
    for effect, fixed in zip(effects, held, strict=True):
        free += [effect.parameter(c.name) for c in effect.terms if c.name not in fixed]
        bounds |= effect_bounds(fitter.problem, model, effect)
        if effect.driver == "constant" and effect.parameter("amplitude") not in a.fit.names:
            start |= limited(model, effect, {effect.parameter("amplitude"): middle})
    return fitter.fit(model, tuple(free), start, a.fit, bounds, rounds=2, noise=a.fit.noise if near else None)
