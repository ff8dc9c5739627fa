"""Which way a fitted effect goes: a physical cause has a sign, and one that goes the other way is not that cause."""

from __future__ import annotations

import numpy as np

from adaptive_flot.discovery.candidates.spline import knots_of, values_of
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.forms.form import CoefficientRole
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.quantities import KnownEffect


def trend(effect: Effect) -> float:
    """Positive where the value at the site rises with the driver over the record (or, of a constant, is larger)."""
    if effect.family.is_curve:
        knots = np.array(knots_of(effect))
        return float((knots - knots.mean()) @ np.array(values_of(effect)))
    order = CoefficientRole.SLOPE, CoefficientRole.GAIN, CoefficientRole.LEVEL, CoefficientRole.BLEND
    return float(next((value for role in order for value in effect.values(role)), 0.0))


def listed(model: Model, effect: Effect) -> KnownEffect | None:
    """The entry of the model's table of known effects for a site and driver."""
    return next((k for k in model.known_effects if (k.site, k.driver) == (effect.site, effect.driver)), None)


def against(model: Model, effect: Effect) -> bool:
    """Whether a fitted effect goes the other way than the known effect of the same site and driver."""
    known = listed(model, effect)
    if known is None or not known.direction:
        return False
    return trend(effect) * (1 if known.direction == "rises" else -1) < 0


def nameable(model: Model, effect: Effect, known: bool) -> bool:
    """Whether a fitted effect may still be called by name, given that its site and driver may.

    What goes against its known direction is an unlisted dependence: of a quantity of the process it is told as such; a
    sensor, an actuator, a feed or a flow has no reason for it.
    """
    site = next((s for s in model.sites if s.name == effect.site), None)
    return known and (not against(model, effect) or (site is not None and site.role == "process"))
