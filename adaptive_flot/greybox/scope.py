"""The symbols of one model while its equations are written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import casadi as ca

from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.effects import DYNAMIC_DRIVERS, STATELESS_DRIVERS, Effect, Mode, apply, remembered
from adaptive_flot.greybox.quantities import Kind

Role = Literal["process", "sensor", "actuator", "feed", "flow"]


@dataclass(frozen=True)
class Site:
    """A quantity that effects may act on.

    Attributes
    ----------
    name
        Name of the site.
    role
        What it is a quantity of: the process, a sensor, an actuator, a feed or a flow.
    mode
        How effects act on it by default, see `Effect.mode`.
    passed
        How often the equations pass it: once for each component of the quantity.
    unit
        Unit of its value, None where the equations do not tell.
    signals
        Signals that are known where it is passed first.
    """

    name: str
    role: Role
    mode: Mode
    passed: int
    unit: str | None = None
    signals: tuple[str, ...] = ()


class Scope:
    """The symbols of one model while its equations are written. Values are scalar `casadi.SX`.

    Attributes
    ----------
    time
        Symbol of the time [s].
    derivatives, decays, outputs, signals, residuals, sites, site_values
        What the equations have given so far, by name.
    factors
        Factor of the value at a site, by its name; none by default. Effects act on the value with its factor.
    """

    def __init__(
        self, symbols: Mapping[Kind, Mapping[str, ca.SX]], time: ca.SX, effects: Sequence[Effect] = ()
    ) -> None:
        self.time = time
        self._symbols = symbols
        self._effects = effects
        self.derivatives: dict[str, ca.SX] = {}
        self.decays: dict[str, ca.SX] = {}
        self.outputs: dict[str, ca.SX] = {}
        self.signals: dict[str, ca.SX] = {}
        self.residuals: dict[str, tuple[ca.SX, ca.SX]] = {}
        self.sites: dict[str, Site] = {}
        self.site_values: dict[str, ca.SX] = {}
        self.factors: Mapping[str, float] = {}
        self._seen: dict[str, ca.SX] = {}

    def _symbol(self, kind: Kind, name: str) -> ca.SX:
        table = self._symbols[kind]
        if name not in table:
            raise ModelError(f"no {name!r} among the model's {kind}; {near_match(name, table)}")
        return table[name]

    def state(self, name: str) -> ca.SX:
        """Symbol of a state."""
        return self._symbol("states", name)

    def input(self, name: str) -> ca.SX:
        """Symbol of an input."""
        return self._symbol("inputs", name)

    def parameter(self, name: str) -> ca.SX:
        """Symbol of a parameter."""
        return self._symbol("parameters", name)

    def parameter_group(self, prefix: str) -> list[ca.SX]:
        """Symbols of all parameters named `prefix.something`, in the order of the model."""
        return [s for name, s in self._symbols["parameters"].items() if name.startswith(prefix + ".")]

    def algebraic(self, name: str) -> ca.SX:
        """Symbol of an algebraic variable; give its equation with `residual`."""
        return self._symbol("algebraic", name)

    def site(
        self, name: str, value: ca.SX, role: Role = "process", mode: Mode = "factor", *, unit: str | None = None
    ) -> ca.SX:
        """Pass a physical quantity through a named site, once or once per component of the same quantity.

        `role` is the kind of thing it is: only sensors, actuators and feeds can lag, only a flow can spill. The guide
        to a model of one's own lists what each role does. `mode` says how an effect acts here unless it says so
        itself: it multiplies the quantity by exp(g), or adds g in the quantity's unit. With `unit`, what an effect
        here is given in can be checked.
        """
        before = self.sites.get(name, Site(name, role, mode, 0, unit, tuple(self.signals)))
        self.sites[name] = replace(before, passed=before.passed + 1)
        value = value * self.factors[name] if name in self.factors else value
        self.site_values.setdefault(name, value)
        at_site = (effect for effect in self._effects if effect.site == name)
        for effect in sorted(at_site, key=lambda e: e.family.is_beside):
            if before.passed and effect.states() and effect.family.memory is None:
                raise ModelError(f"{effect.label}: form {effect.form!r} has states, but the site has components")
            if effect.label not in self._seen:  # the components of a site have one driver in common
                self._seen[effect.label] = remembered(effect, self, self._driver(effect))
            value = apply(effect, self, value, self._seen[effect.label], effect.mode or mode)
        return value

    def _driver(self, effect: Effect) -> ca.SX:
        if effect.driver in ("time", *DYNAMIC_DRIVERS):  # what is late may go by the clock
            return self.time
        if effect.driver in STATELESS_DRIVERS:
            return ca.SX(0)
        known = {**self._symbols["inputs"], **self._symbols["states"], **self.signals}
        if effect.driver not in known and effect.follower in known:
            return known[effect.follower]
        if effect.driver not in known:
            raise ModelError(
                f"effect at site {effect.site!r}: driver {effect.driver!r} is not known where the site is passed; "
                f"{near_match(effect.driver, (*known, *STATELESS_DRIVERS))}"
            )
        return known[effect.driver]

    def signal(self, name: str, value: ca.SX) -> ca.SX:
        """Name an internal quantity that tables, plots and effects may use."""
        return self._define(self.signals, "signal", name, value)

    def late_signal(self, name: str, value: ca.SX, rate: ca.SX) -> ca.SX:
        """Name a quantity that is known only after the sites; what depends on it follows it at a rate [1/s]."""
        for effect in self._effects:
            if effect.driver == name:
                follower = self.state(effect.follower)
                self.derivative(effect.follower, rate * (value - follower), decay=-rate)
        return self.signal(name, value)

    def derivative(self, name: str, value: ca.SX, decay: ca.SX | None = None) -> None:
        """Give d(state)/dt in the state's unit per second.

        `decay` [1/s], for a fast state, is the (negative) factor of the state itself in its derivative. The fast step
        integrates that part exactly; it changes how large a step may be, not what the equations mean.
        """
        self._symbol("states", name)
        self._define(self.derivatives, "derivative", name, value)
        if decay is not None:
            self.decays[name] = decay

    def output(self, name: str, value: ca.SX) -> None:
        """Give an output."""
        self._define(self.outputs, "output", name, value)

    def residual(self, name: str, value: ca.SX, guess: ca.SX) -> None:
        """Give the equation `value = 0` of an algebraic variable and an explicit first guess of it."""
        self._symbol("algebraic", name)
        if name in self.residuals:
            raise ModelError(f"residual {name!r} is given twice; give each equation once")
        self.residuals[name] = (value, guess)

    def time_derivative(self, expression: ca.SX) -> ca.SX:
        """d(expression)/dt by the chain rule over the states whose derivative has been given already."""
        names = list(self.derivatives)
        states = ca.vertcat(*(self._symbols["states"][n] for n in names))
        rates = ca.vertcat(*(self.derivatives[n] for n in names))
        partial_time = ca.jacobian(expression, self.time)
        return ca.jtimes(expression, states, rates) + partial_time

    @staticmethod
    def _define(table: dict[str, ca.SX], what: str, name: str, value: ca.SX) -> ca.SX:
        if name in table:
            raise ModelError(f"{what} {name!r} is given twice; give each equation once")
        table[name] = value
        return value
