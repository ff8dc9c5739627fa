"""A model with sites where it has none: at the balances of its states, and at its inputs.

Four things may act there. With the balance ``dx/dt = f(x, u)``, an input u, and A the change::

    balance of x    dx/dt = f + A               a leak, a load, a heat that nobody counts
    loss of x       dx/dt = f - A x / |x|_max   a leak in proportion to what is there
    rate of x       dx/dt = f exp(A)            another capacity, volume or mass: exp(-A) times as large
    reading of u    dx/dt = f(x, u + A)         an input that is another than the record says
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.quantities import Quantity
from adaptive_flot.greybox.scope import Scope, Site

BALANCE, LOSS, RATE, READING = "balance of ", "loss of ", "rate of ", "reading of "
"""How the names of the further sites begin."""


class _Read(Scope):
    """A scope whose inputs pass a site each, where they are asked for first; all else is that of the scope given."""

    def __init__(self, scope: Scope) -> None:
        self.__dict__ = scope.__dict__
        self._read: dict[str, ca.SX] = {}

    def input(self, name: str) -> ca.SX:
        if name not in self._read:
            self._read[name] = self.site(READING + name, super().input(name), "actuator", "offset")
        return self._read[name]


@dataclass(frozen=True)
class _WithFurtherSites:
    """The equations of a model, with a site at each input and some at the derivative of each of some states."""

    equations: Callable[[Scope], None]
    states: tuple[str, ...]
    stores: tuple[str, ...]
    sizes: tuple[tuple[str, float], ...]

    def __call__(self, m: Scope) -> None:
        self.equations(_Read(m))
        sizes = dict(self.sizes)
        for name in self.states:
            rate = m.derivatives[name]
            if name in self.stores:
                rate = m.site(RATE + name, rate, "process")
            if name in sizes:
                lost = m.site(LOSS + name, ca.SX(0), "process", "offset")
                rate = rate - lost * m.state(name) / sizes[name]
            m.derivatives[name] = m.site(BALANCE + name, rate, "process", "offset")


def with_further_sites(model: Model) -> Model:
    """The model with sites where it has none, each without an effect: it gives the same run.

    What states alone move is no store: a position, by its speed. And nothing is in proportion to what has no zero.
    """
    by = np.hstack([np.array(ca.DM(model.ode.jac_sparsity(0, k), 1)) for k in (2, 3)])
    moved: list[bool] = np.any(by != 0, axis=1).tolist()
    own = [(s, m) for s, m in zip(model.states, moved, strict=True) if "." not in s.name]  # not those of effects
    stores = tuple(s.name for s, is_store in own if is_store)
    sizes = tuple((s.name, loss_size(s)) for s, is_store in own if is_store and not s.zero_is_arbitrary)
    return replace(model, equations=_WithFurtherSites(model.equations, tuple(s.name for s, _ in own), stores, sizes))


def loss_size(state: Quantity) -> float:
    """The amount of a state at which a loss in proportion to it is the amount that is told."""
    ends = [abs(e) for e in (state.lower, state.upper) if np.isfinite(e)]
    return max(ends, default=0.0) or state.scale or 1.0


def further_sites(model: Model) -> tuple[Site, ...]:
    """The further sites of such a model."""
    return tuple(s for s in model.sites if s.name.startswith((BALANCE, LOSS, RATE, READING)))


def stays_in_range(model: Model, record: Dataset, place: str, amount: float) -> bool:
    """Whether an input that is off by an amount stays within the range of its quantity; of another place, always."""
    if not place.startswith(READING):
        return True
    i = model.index("inputs", place.removeprefix(READING))
    low, high = np.nanquantile(record.inputs[:, i], (0.05, 0.95)) + amount
    return bool(model.inputs[i].lower <= low and high <= model.inputs[i].upper)
