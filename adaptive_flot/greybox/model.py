"""A grey-box model: named physical quantities and the equations between them, symbolic in CasADi.

The engine knows nothing of flotation. A process is a list of `Quantity` and `Parameter` and one function that
writes the equations into a `Scope`::

    def equations(m: Scope) -> None:
        level = m.state("level")
        outflow = m.site("outflow", m.parameter("k") * ca.sqrt(level))
        m.derivative("level", m.input("inflow") - outflow)
        m.output("level", m.site("level_sensor", level))

Every quantity in which physics may be missing passes through a named *site*. A site returns its value unchanged;
`Model.with_effects` attaches an `Effect` there without touching the equations.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import casadi as ca
import numpy as np

from adaptive_flot.errors import ModelError, RangeError, near_match
from adaptive_flot.greybox.build import Built, build, tangent
from adaptive_flot.greybox.effects import Effect, check_distinct
from adaptive_flot.greybox.quantities import FloatArray, Kind, KnownEffect, Parameter, Quantity
from adaptive_flot.greybox.scope import Scope, Site

__all__ = ["Effect", "FloatArray", "Kind", "Model", "Parameter", "Quantity", "Scope"]


@dataclass(frozen=True)
class Model:
    """Named quantities plus equations; building it compiles nothing and takes milliseconds.

    Attributes `dae`, `ode` and `decay`, and what `tangent(seeds)` returns, are CasADi functions of `(t, x, u, p[, z])`:

    ========= ============================================= ==========================================
    function  arguments                                     results
    ========= ============================================= ==========================================
    `dae`     t, x (nx,), u (nu,), p (np,), z (nz,)         dx/dt (nx,), residual (nz,), y (ny,), s (ns,)
    `ode`     t, x, u, p                                    dx/dt, y, s, z, with z solved inside
    `tangent` t, x, u, p, dx (nx, q)                        dx/dt, y, decay; then their derivatives along (dx, seeds)
    `decay`   t, x, u, p, z                                 decay rate of each state (nx,), 0 where none is given
    ========= ============================================= ==========================================

    Raises
    ------
    ModelError
        A derivative, output, signal or residual is missing, given twice or not declared.
    """

    name: str
    states: tuple[Quantity, ...]
    inputs: tuple[Quantity, ...]
    parameters: tuple[Parameter, ...]
    outputs: tuple[Quantity, ...]
    equations: Callable[[Scope], None]
    signals: tuple[Quantity, ...] = ()
    algebraic: tuple[Quantity, ...] = ()
    initial_guess: Mapping[str, float] = field(default_factory=dict)
    """First guess of the steady state by state name; the scale of the state where it is not given."""
    max_step_s: float = 1.0
    """Largest step [s] at which the fast integration of this model is accurate (about 1e-5 of each state)."""
    starts_steady: bool = True
    """A record without further knowledge is taken to start near a steady state; else near `initial_guess`."""
    drivers: tuple[str, ...] = ()
    """Quantities that effects may depend on, in the order of a search; default all inputs and states."""
    late_drivers: tuple[str, ...] = ()
    """Drivers that are known only after the sites: signals which an effect follows through a state of its own."""
    known_effects: tuple[KnownEffect, ...] = ()
    """What a search may call by name; when empty, every site with every driver."""
    edges: tuple[str, ...] = ()
    """Outputs that may stay at the highest or lowest value of their range: no sensor is clipped there."""
    effects: tuple[Effect, ...] = ()
    """Effects attached by `with_effects`; their parameters and states follow those of the model."""
    compiled: bool = False
    """Steppers and estimators of this model turn what they call in a loop into machine code (`greybox/compiled.py`)."""

    def __post_init__(self) -> None:
        _ = self._built  # equations are checked when the model is made, not when it is first used

    # -- names -----------------------------------------------------------------------------------------------------

    def names(self, kind: Kind) -> tuple[str, ...]:
        """Names of one kind of quantity, in vector order."""
        return tuple(q.name for q in getattr(self, kind))

    def index(self, kind: Kind, name: str) -> int:
        """Position of a quantity in its vector; parameters answer to name and symbol.

        Raises
        ------
        ModelError
            No such quantity; the message holds the nearest name.
        """
        for i, quantity in enumerate(getattr(self, kind)):
            if name == quantity.name or (isinstance(quantity, Parameter) and name == quantity.symbol):
                return i
        symbols = (q.symbol for q in getattr(self, kind) if isinstance(q, Parameter) and q.symbol)
        known = near_match(name, (*self.names(kind), *symbols))
        raise ModelError(f"model '{self.name}' has no {name!r} among its {kind}; {known}")

    def indices(self, kind: Kind, names: Iterable[str]) -> list[int]:
        """Positions of several quantities."""
        return [self.index(kind, name) for name in names]

    def expand_parameters(self, names: Iterable[str]) -> tuple[str, ...]:
        """Full parameter names for names, symbols and group prefixes (`floatability` is all its minerals)."""
        found: list[str] = []
        for name in names:
            group = [p.name for p in self.parameters if p.name.startswith(name + ".")]
            found += group or [self.parameters[self.index("parameters", name)].name]
        return tuple(dict.fromkeys(found))

    @property
    def parameter_values(self) -> FloatArray:
        """Parameter vector (np,), each in its unit."""
        return np.array([p.value for p in self.parameters], dtype=float)

    def with_parameters(self, values: Mapping[str, float]) -> Model:
        """Return the same model with other parameter values.

        Raises
        ------
        ModelError
            Unknown parameter.
        RangeError
            A value outside the parameter's physical range.
        """
        new = list(self.parameters)
        for name, value in values.items():
            p = new[i := self.index("parameters", name)]
            if not (np.isfinite(value) and p.lower <= value <= p.upper):
                raise RangeError(
                    f"parameter {p.name!r} = {value:g} {p.unit} is outside its physical range "
                    f"[{p.lower:g}, {p.upper:g}] {p.unit}; give a value inside it"
                )
            new[i] = replace(p, value=float(value))
        _, other = self.kept, copy.copy(self)  # the values are arguments of all functions: both models share these
        object.__setattr__(other, "parameters", tuple(new))
        return other

    def with_effects(self, effects: Iterable[Effect]) -> Model:
        """Return this model with further effects; coefficients become parameters, filters become states.

        Raises
        ------
        ModelError
            Unknown site or driver, a driver that is not known where the site is passed, or two effects of one name.
        """
        added = tuple(effects)
        check_distinct((*self.effects, *added))
        return replace(
            self,
            states=self.states + tuple(s for e in added for s in self._effect_states(e)),
            parameters=self.parameters + tuple(p for e in added for p in e.parameters(self.effect_units(e))),
            effects=self.effects + added,
        )

    def without_effects(self) -> Model:
        """Return this model without its effects; its own parameters keep their present values."""
        states = len(self.states) - sum(len(self._effect_states(e)) for e in self.effects)
        parameters = len(self.parameters) - sum(len(e.terms) for e in self.effects)
        return replace(self, states=self.states[:states], parameters=self.parameters[:parameters], effects=())

    def _effect_states(self, effect: Effect) -> tuple[Quantity, ...]:
        """States of an effect: those of its form, and one that follows a late driver."""
        if effect.driver not in self.late_drivers:
            return effect.states()
        driver = self.signals[self.index("signals", effect.driver)]
        follower = f"{driver.name} as it reaches {effect.site}"
        return (*effect.states(), replace(driver, name=effect.follower, description=follower))

    def effect_units(self, effect: Effect) -> dict[str, str | None]:
        """Unit of each coefficient and setting of an effect on this model; None where its site does not tell its unit.

        Raises
        ------
        ModelError
            Unknown site.
        """
        sites = {s.name: s for s in self.sites}
        if effect.site not in sites:
            raise ModelError(f"model '{self.name}' has no site {effect.site!r}; {near_match(effect.site, sites)}")
        units = {q.name: q.unit for q in (*self.inputs, *self.states, *self.signals)} | {"time": "s"}
        site = sites[effect.site]
        return effect.units(site.unit, units.get(effect.driver), site.mode)

    def check_inputs(self, inputs: FloatArray, time: FloatArray | None = None, where: str = "inputs") -> None:
        """Check an input table (N, nu) against the physical range of each input.

        Raises
        ------
        RangeError
            Names the first input that leaves its range, the row or time, the value and the range.
        """
        table = np.atleast_2d(np.asarray(inputs, dtype=float))
        if table.shape[1] != len(self.inputs):
            raise ModelError(f"{where}: {table.shape[1]} columns, but the model has {len(self.inputs)} inputs")
        for j, q in enumerate(self.inputs):
            bad = np.flatnonzero(~((table[:, j] >= q.lower) & (table[:, j] <= q.upper)))
            if bad.size:
                k = int(bad[0])
                at = f"row {k}" if time is None else f"time {time[k]:g} s"
                raise RangeError(
                    f"{where}: {q.name} = {table[k, j]:g} {q.unit} at {at} is outside the model's range "
                    f"[{q.lower:g}, {q.upper:g}] {q.unit}; correct the value or its unit"
                )

    # -- built functions -------------------------------------------------------------------------------------------

    @property
    def dae(self) -> ca.Function:
        """Semi-explicit DAE, see the class."""
        return self._built.dae

    @property
    def ode(self) -> ca.Function:
        """Explicit right-hand side with the algebraic loop closed inside, see the class."""
        return self._built.ode

    def tangent(self, seeds: ca.DM) -> ca.Function:
        """The right-hand side, the outputs and their derivatives along q directions, z moving along; see the class.

        The directions are (dx, seeds): `seeds` (np, q) are those of the parameters, constants, most of them zero.
        """
        key = "tangent", seeds.shape, tuple(seeds.sparsity().find()), tuple(seeds.nonzeros())
        if key not in self.kept:
            self.kept[key] = tangent(self.ode, self.dae, self.decay, seeds)
        return self.kept[key]

    @property
    def decay(self) -> ca.Function:
        """Decay rates of the fast states, see the class."""
        return self._built.decay

    @property
    def sites(self) -> tuple[Site, ...]:
        """Sites that the equations pass through, in their order."""
        return self._built.sites

    @property
    def site_values(self) -> ca.Function:
        """`(t, x, u, p, z)` to the value at each site (sites,) before any effect; the first of several components."""
        return self._built.site_values

    def fitted_effects(self) -> tuple[Effect, ...]:
        """Effects with the present parameter values as their coefficients."""
        values = {p.name: p.value for p in self.parameters}
        return tuple(
            replace(e, coefficients={c.name: values[e.parameter(c.name)] for c in e.terms}) for e in self.effects
        )

    @cached_property
    def kept(self) -> dict[Hashable, ca.Function]:
        """Functions derived from this model, by what they are; shared with models of other parameter values."""
        return {}

    @cached_property
    def _built(self) -> Built:
        kinds: tuple[Kind, ...] = ("states", "inputs", "parameters", "outputs", "signals", "algebraic")
        return build(self.name, {kind: self.names(kind) for kind in kinds}, self.equations, self.effects)
