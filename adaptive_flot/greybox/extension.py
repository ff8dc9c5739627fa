"""A model with further effects, and without them: what each adds to its states and parameters."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.effects import Effect, check_distinct
from adaptive_flot.greybox.quantities import Quantity

if TYPE_CHECKING:
    from adaptive_flot.greybox.model import Model


def with_effects(model: Model, added: tuple[Effect, ...]) -> Model:
    """See `Model.with_effects`."""
    check_distinct((*model.effects, *added))
    return replace(
        model,
        states=model.states + tuple(s for e in added for s in _states(model, e)),
        parameters=model.parameters + tuple(p for e in added for p in e.parameters(effect_units(model, e))),
        effects=model.effects + added,
    )


def without_effects(model: Model) -> Model:
    """See `Model.without_effects`."""
    states = len(model.states) - sum(len(_states(model, e)) for e in model.effects)
    parameters = len(model.parameters) - sum(len(e.terms) for e in model.effects)
    return replace(model, states=model.states[:states], parameters=model.parameters[:parameters], effects=())


def effect_units(model: Model, effect: Effect) -> dict[str, str | None]:
    """Unit of each coefficient and setting of an effect on a model; None where its site does not tell its unit.

    Raises
    ------
    ModelError
        Unknown site.
    """
    sites = {s.name: s for s in model.sites}
    if effect.site not in sites:
        raise ModelError(f"model '{model.name}' has no site {effect.site!r}; {near_match(effect.site, sites)}")
    units = {q.name: q.unit for q in (*model.inputs, *model.states, *model.signals)} | {"time": "s"}
    site = sites[effect.site]
    return effect.units(site.unit, units.get(effect.driver), site.mode)


def _states(model: Model, effect: Effect) -> tuple[Quantity, ...]:
    """States of an effect: those of its form, and one that follows a late driver."""
    if effect.driver not in model.late_drivers:
        return effect.states()
    driver = model.signals[model.index("signals", effect.driver)]
    follower = f"{driver.name} as it reaches {effect.site}"
    return (*effect.states(), replace(driver, name=effect.follower, description=follower))
