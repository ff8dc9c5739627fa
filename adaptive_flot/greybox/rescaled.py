"""A model with other constants: the value at a site times a factor, without a parameter or an effect of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.scope import Scope


@dataclass(frozen=True)
class _Rescaled:
    """The equations of a model, with the value at some sites times a factor."""

    equations: Callable[[Scope], None]
    factors: Mapping[str, float]

    def __call__(self, m: Scope) -> None:
        m.factors = self.factors
        self.equations(m)


def rescaled(model: Model, factors: Mapping[str, float]) -> Model:
    """The model with the value at each of these sites times its factor, and those at all others as they came."""
    return replace(as_it_came(model), equations=_Rescaled(_own(model), dict(factors)))


def as_it_came(model: Model) -> Model:
    """The model without factors; its effects and parameters stay."""
    return replace(model, equations=_own(model))


def factors_of(model: Model) -> Mapping[str, float]:
    """Factors of a model by site; empty where it has none."""
    return model.equations.factors if isinstance(model.equations, _Rescaled) else {}


def logarithms_of_factors(model: Model, sites: Sequence[str]) -> FloatArray:
    """Logarithm of the factor at each of some sites (k,); zero where there is none."""
    factors = factors_of(model)
    return np.log([factors.get(site, 1.0) for site in sites])


def factors_as_effects(model: Model) -> Model:
    """The same model with each factor written as a constant effect at its site, as a model file can hold it.

    An effect that is there already takes the factor up: both multiply, so their logarithms add.
    """
    own = as_it_came(model)
    for site, factor in factors_of(model).items():
        effect = Effect(site, "constant", "shift", mode="factor", coefficients={"amplitude": float(np.log(factor))})
        name = effect.parameter("amplitude")
        if any(e.label == effect.label for e in own.effects):
            there = own.parameters[own.index("parameters", name)].value
            own = own.with_parameters({name: there + float(np.log(factor))})
        else:
            own = own.with_effects([effect])
    return own


def _own(model: Model) -> Callable[[Scope], None]:
    return model.equations.equations if isinstance(model.equations, _Rescaled) else model.equations
