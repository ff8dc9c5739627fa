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
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, TypeVar, TypeVarTuple

import casadi as ca
import numpy as np

from adaptive_flot.described import Described
from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.build import Built, build, tangent
from adaptive_flot.greybox.effects import Effect, check_distinct
from adaptive_flot.greybox.function_cache import FunctionCache, functions_of
from adaptive_flot.greybox.model_checks import GROUPS, Checks
from adaptive_flot.greybox.quantities import FloatArray, Kind, KnownEffect, Parameter, Quantity
from adaptive_flot.greybox.scope import Scope, Site

__all__ = ["Effect", "FloatArray", "Kind", "Model", "Parameter", "Quantity", "Scope"]

Arguments = TypeVarTuple("Arguments")
MOST_EXTENDED = 64
"""Kinds of effects whose equations a model keeps: a search comes back to those of a few rounds."""
STEPS_BESIDE_A_TURN = 4
"""Integration steps, for each of the model's own, beside an effect that turns with the sign of a signal."""
Made = TypeVar("Made")
_BESIDE_VALUE = tuple(f.name for f in fields(Parameter) if f.name != "value")


@dataclass(frozen=True, repr=False)
class Model(Checks, Described):
    """Named quantities plus equations; building it compiles nothing and takes milliseconds.

    Properties `dae`, `ode` and `decay`, and what `tangent(seeds)` returns, are CasADi functions of `(t, x, u, p[, z])`:

    ========= ============================================= ==========================================
    function  arguments                                     results
    ========= ============================================= ==========================================
    `dae`     t, x (nx,), u (nu,), p (np,), z (nz,)         dx/dt (nx,), residual (nz,), y (ny,), s (ns,)
    `ode`     t, x, u, p                                    dx/dt, y, s, z, with z solved inside
    `tangent` t, x, u, p, dx (nx, q)                        dx/dt, y, decay; then their derivatives along (dx, seeds)
    `decay`   t, x, u, p, z                                 decay rate of each state (nx,), 0 where none is given
    ========= ============================================= ==========================================

    Attributes
    ----------
    name
        Name in messages and files.
    states, inputs, parameters, outputs
        The nx states, nu inputs, np parameters and ny outputs, in vector order.
    equations
        Function that writes the equations into a `Scope`.
    signals, algebraic
        The ns internal quantities that tables and effects may use, and the nz algebraic variables.
    initial_guess
        First guess of the steady state by state name; the scale of the state where it is not given.
    max_step_s
        Largest step [s] at which the fast integration of this model is accurate (about 1e-5 of each state).
    starts_steady
        Whether a record without further knowledge starts near the steady state of its first inputs; else near
        `initial_guess`. Reports say where this was assumed and does not hold.
    drivers
        Quantities that effects may depend on, in the order of a search; default all inputs and states.
    late_drivers
        Drivers that are known only after the sites: signals which an effect follows through a state of its own.
    known_effects
        Effects that a search may call by name; when empty, every site with every driver.
    edges
        Outputs that may stay at the highest or lowest value of their range: no sensor is clipped there.
    effects
        Effects attached by `with_effects`; their parameters and states follow those of the model.
    compiled
        Whether steppers and estimators turn what they call in a loop into machine code.
    record_code
        Whether runs of whole records that take many steps are machine code where a compiler is; see
        `stepping/whole_record`. Their numbers agree with the plain ones to rounding.

    Raises
    ------
    ModelError
        A derivative, output, signal or residual is missing, given twice or not declared. A field names something that
        the model has not, or holds a value out of range.
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
    max_step_s: float = 1.0
    starts_steady: bool = True
    drivers: tuple[str, ...] = ()
    late_drivers: tuple[str, ...] = ()
    known_effects: tuple[KnownEffect, ...] = ()
    edges: tuple[str, ...] = ()
    effects: tuple[Effect, ...] = ()
    compiled: bool = False
    record_code: bool = True
    _functions: FunctionCache[Any] = field(default_factory=FunctionCache, init=False, repr=False, compare=False)
    _extended: FunctionCache[Model] = field(
        default_factory=lambda: FunctionCache(MOST_EXTENDED), init=False, repr=False, compare=False
    )

    def __post_init__(self) -> None:
        self.check_groups()
        for name in GROUPS:  # a model file may have lists
            object.__setattr__(self, name, tuple(getattr(self, name)))
        written = self._written()  # equations are checked when the model is made, not when it is first used
        self.check_names()
        functions = functions_of((written, self._tables()), sum(map(len, written)))
        object.__setattr__(self, "_functions", functions)

    def described(self) -> Mapping[str, object]:
        """What it is made of; see `Described`."""
        kinds: tuple[Kind, ...] = ("states", "inputs", "outputs")
        return {
            "name": self.name,
            **{kind: ", ".join(self.names(kind)) for kind in kinds},
            "parameters": len(self.parameters),
            "effects": ", ".join(e.label for e in self.effects) or "none",
        }

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
            i = self.index("parameters", name)
            new[i] = new[i].with_value(value)
        other = copy.copy(self)  # parameter values are arguments of all functions: both models share these
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
        parameters = self.parameters + tuple(p for e in added for p in e.parameters(self.effect_units(e)))

        def extended() -> Model:
            states = self.states + self._effect_states(added)
            return replace(self, states=states, parameters=parameters, effects=self.effects + added)

        # coefficients are arguments of all functions: effects of the same structure share these
        other = copy.copy(self._extended.get(tuple(e.structure for e in added), extended))
        object.__setattr__(other, "parameters", parameters)
        object.__setattr__(other, "effects", self.effects + added)
        return other

    def without_effects(self) -> Model:
        """Return this model without its effects; its own parameters keep their present values."""
        states = len(self.states) - len(self._effect_states(self.effects))
        parameters = len(self.parameters) - sum(len(e.terms) for e in self.effects)
        return replace(self, states=self.states[:states], parameters=self.parameters[:parameters], effects=())

    def _effect_states(self, effects: tuple[Effect, ...]) -> tuple[Quantity, ...]:
        late = {name: self.signals[self.index("signals", name)] for name in self.late_drivers}
        return tuple(state for e in effects for state in e.states(late.get(e.driver)))

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
        site = sites[effect.site]
        units = {q.name: q.unit for q in (*self.inputs, *self.states, *self.signals)} | {"time": "s"}
        return effect.units(site.unit, units.get(effect.driver), site.mode)

    def fitted_effects(self) -> tuple[Effect, ...]:
        """Effects with the present parameter values as their coefficients."""
        values = {p.name: p.value for p in self.parameters}
        return tuple(
            replace(e, coefficients={c.name: values[e.parameter(c.name)] for c in e.terms}) for e in self.effects
        )

    @property
    def first_guess(self) -> FloatArray:
        """State (nx,) of `initial_guess`; the scale of a state where that has none."""
        return np.array([self.initial_guess.get(q.name, q.scale) for q in self.states])

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
        key = tangent, seeds.shape, tuple(seeds.sparsity().find()), tuple(seeds.nonzeros())
        made: ca.Function = self._functions.get(key, lambda: tangent(self._built, seeds))
        return made

    def steps_in(self, dt: float) -> int:
        """Steps of the fast integration in dt [s], as many as `longest_step_s` asks for."""
        return max(1, math.ceil(dt / self.longest_step_s - 1e-9))

    @property
    def longest_step_s(self) -> float:
        """Longest integration step [s]: `max_step_s`, and a share of it with an effect that turns with a sign.

        The right-hand side of such a model has nearly a jump, and is the stiffer the larger that is.
        """
        return self.max_step_s / (STEPS_BESIDE_A_TURN if any(e.family.turns for e in self.effects) else 1)

    @property
    def jumping(self) -> tuple[bool, ...]:
        """Of each state whether it moves at once at times: its decay rate is then far larger than one over the step."""
        jumping = tuple(f"{e.label}." for e in self.effects if e.family.jumps)
        return tuple(name.startswith(jumping) for name in self.names("states"))

    def derived(self, builder: Callable[[Model, *Arguments], Made], *arguments: *Arguments) -> Made:
        """Return `builder(model, *arguments)`, made once for all models that differ in no more than parameter values.

        Parameters
        ----------
        builder
            A function of a module. What it makes may depend on the equations, not on the values of parameters.
        arguments
            Its further arguments, hashable. Builder and arguments together are the key.
        """
        made: Made = self._functions.get((builder, arguments), lambda: builder(self, *arguments))
        return made

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

    def _written(self) -> tuple[str, ...]:
        """Its equations as text."""
        return tuple(f.serialize() for f in (self._built.dae, self._built.decay, self._built.site_values))

    def _tables(self) -> str:
        """What its functions depend on beside its equations: all but the values of its parameters, as text.

        A quantity may hold what can not be a key, such as a list.
        """
        parameters = tuple(tuple(getattr(p, name) for name in _BESIDE_VALUE) for p in self.parameters)
        tables = self.states, self.inputs, parameters, self.outputs, self.signals, self.algebraic, self._built.sites
        how = self.name, self.max_step_s, self.compiled, self.record_code, tuple(e.structure for e in self.effects)
        return repr((tables, how))

    @cached_property
    def _built(self) -> Built:
        kinds: tuple[Kind, ...] = ("states", "inputs", "parameters", "outputs", "signals", "algebraic")
        return build(self.name, {kind: self.names(kind) for kind in kinds}, self.equations, self.effects)
