"""A model with sites where it has none: at the balances of its states, at its inputs, and beside what is a factor.

Six things may act there. With the balance ``dx/dt = f(x, u)``, an input u, a site of value v, and A the change::

    balance of x    dx/dt = f + A               a leak, a load, a heat that nobody counts
    loss of x       dx/dt = f - A x / x_max     a leak in proportion to what is there
    drag on x       dx/dt = f - A x |x| / x_max^2   a resistance that grows with the square of a flow or a speed
    rate of x       dx/dt = f exp(A)            another capacity, volume or mass: exp(-A) times as large
    reading of u    dx/dt = f(x, u + A)         an input that is another than the record says
    amount at v     v + A                       a seat that no longer closes, where a change is a factor
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Mode
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.quantities import Quantity
from adaptive_flot.greybox.scope import Role, Scope, Site

BALANCE, LOSS, DRAG, RATE, READING, AMOUNT = (
    "balance of ", "loss of ", "drag on ", "rate of ", "reading of ", "amount at ",
)  # fmt: skip
"""How the names of the further sites begin."""
ENDS, ROUNDING = (0.05, 0.95), 0.01
"""Quantiles that stand for the ends of what was seen, and a share of their distance that is none."""
LARGEST_STORE = 10.0
"""Largest factor between what a state stores and what the model says."""
INNER = ("process", "flow")
"""Roles of what lies between inputs and outputs: there alone an amount says what no other site does."""


class _Beside(Scope):
    """The scope given, with a site at each input where it is asked for first, and beside each factor of the process."""

    def __init__(self, scope: Scope) -> None:
        self.__dict__ = scope.__dict__
        self._read: dict[str, ca.SX] = {}

    def input(self, name: str) -> ca.SX:
        if name not in self._read:
            self._read[name] = self.site(READING + name, super().input(name), "actuator", "offset")
        return self._read[name]

    def site(
        self, name: str, value: ca.SX, role: Role = "process", mode: Mode = "factor", *, unit: str | None = None
    ) -> ca.SX:
        value = super().site(name, value, role, mode, unit=unit)
        constants = {s.name() for s in self._symbols["parameters"].values()}
        if role not in INNER or mode != "factor" or {s.name() for s in ca.symvar(value)} <= constants:
            return value
        return super().site(AMOUNT + name, value, "process", "offset", unit=unit)


@dataclass(frozen=True)
class _WithFurtherSites:
    """The equations of a model, with sites at inputs and factors, and some at the derivative of each of some states."""

    equations: Callable[[Scope], None]
    states: tuple[str, ...]
    stores: tuple[str, ...]
    sizes: tuple[tuple[str, float], ...]

    def __call__(self, m: Scope) -> None:
        self.equations(_Beside(m))
        sizes = dict(self.sizes)
        for name in self.states:
            rate = m.derivatives[name]
            if name in self.stores:
                rate = m.site(RATE + name, rate, "process")
            if name in sizes:
                lost, braked = (m.site(kind + name, ca.SX(0), "process", "offset") for kind in (LOSS, DRAG))
                share = m.state(name) / sizes[name]
                rate = rate - lost * share - braked * share * ca.fabs(share)
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
    return tuple(s for s in model.sites if is_further(s.name))


def is_further(name: str) -> bool:
    """Whether a site is one of these, by its name."""
    return name.startswith((BALANCE, LOSS, DRAG, RATE, READING, AMOUNT))


def is_part(place: str, site: str) -> bool:
    """Whether a further site is beside a site of the model: the part is the same, and it changes in another way."""
    return place == AMOUNT + site


def is_possible(model: Model, record: Dataset, place: str, amount: float, value: FloatArray) -> bool:
    """Whether a change at a further site is one that can be; at a balance, any.

    An input stays within the range of its quantity. No store becomes ten times as large, which would be one that
    hardly moves. What has only had one sign keeps it: a heater that gives less than nothing is none.

    Parameters
    ----------
    model, record
        The model and a record.
    place, amount
        Name of the further site, and the amount there; the logarithm of a factor at a rate.
    value
        Values of the place in the record (N,).
    """
    if place.startswith(READING):
        i = model.index("inputs", place.removeprefix(READING))
        low, high = np.nanquantile(record.inputs[:, i], ENDS) + amount
        return bool(model.inputs[i].lower <= low and high <= model.inputs[i].upper)
    if place.startswith(RATE):
        return bool(abs(amount) <= np.log(LARGEST_STORE))
    if place.startswith(AMOUNT):
        low, high = np.quantile(value, ENDS)
        slack = ROUNDING * float(high - low)
        return bool((low < 0 or low + amount >= -slack) and (high > 0 or high + amount <= slack))
    return True
