"""A grey-box model: named physical quantities and the equations between them, symbolic in CasADi.

The engine knows nothing of flotation. A process is a list of `Quantity` and `Parameter` and one function that
writes the equations into a `Scope`::

    def equations(m: Scope) -> None:
        level = m.state("level")
        outflow = m.site("outflow", m.parameter("k") * ca.sqrt(level))
        m.derivative("level", m.input("inflow") - outflow)
        m.output("level", m.site("level_sensor", level))

Every quantity in which physics may be missing passes through a named *site*. A site returns its value unchanged;
it is the place where an effect can be attached without touching the equations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from adaptive_flot.errors import ModelError, RangeError, near_match

FloatArray = NDArray[np.float64]
Kind = Literal["states", "inputs", "parameters", "outputs", "signals", "algebraic"]

NEWTON_STEPS = 2
"""Newton iterations that close the algebraic loop inside the explicit right-hand side. Convergence is quadratic from a
physical guess: in the flotation cell the first leaves 1e-6 of the gas velocity, the second less than 1e-11."""


@dataclass(frozen=True)
class Quantity:
    """A named physical quantity: state, input, output, signal or algebraic variable.

    `lower` and `upper` are the physical range in the unit given; `scale` is a typical size, used to condition
    solvers and as the standard deviation of an unknown initial state.
    """

    name: str
    unit: str
    description: str
    lower: float = -np.inf
    upper: float = np.inf
    scale: float = 1.0

    @property
    def column(self) -> str:
        """Name of the table column: the name, then the unit as a suffix.

        >>> Quantity("air_flow", "m3/s", "air").column
        'air_flow_m3_s'
        """
        return self.name if self.unit == "-" else f"{self.name}_{self.unit.replace('/', '_').replace(' ', '_')}"


@dataclass(frozen=True)
class Parameter:
    """A model parameter with its value, unit, source, physical range and role in a calibration.

    `symbol` is the letter of the literature, accepted wherever the name is. `scale` is the size of a change that
    matters (relative scale of fits); `prior_std` the standard deviation of the prior in a calibration, None for none.
    """

    name: str
    value: float
    unit: str
    source: str
    symbol: str | None = None
    lower: float = -np.inf
    upper: float = np.inf
    scale: float = 1.0
    prior_std: float | None = None
    role: Literal["fixed", "estimated"] = "fixed"

    @property
    def label(self) -> str:
        """Symbol where there is one, else the name: what tables and plots print."""
        return self.symbol or self.name


class Scope:
    """The symbols of one model while its equations are written. Values are scalar `casadi.SX`."""

    def __init__(self, symbols: Mapping[Kind, Mapping[str, ca.SX]], time: ca.SX) -> None:
        self.time = time
        self._symbols = symbols
        self.derivatives: dict[str, ca.SX] = {}
        self.decays: dict[str, ca.SX] = {}
        self.outputs: dict[str, ca.SX] = {}
        self.signals: dict[str, ca.SX] = {}
        self.residuals: dict[str, tuple[ca.SX, ca.SX]] = {}
        self.sites: dict[str, ca.SX] = {}

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

    def site(self, name: str, value: ca.SX) -> ca.SX:
        """Pass a physical quantity through a named site, once or once per component of the same quantity."""
        self.sites.setdefault(name, value)
        return value

    def signal(self, name: str, value: ca.SX) -> ca.SX:
        """Name an internal quantity that tables, plots and effects may use."""
        return self._define(self.signals, "signal", name, value)

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


@dataclass(frozen=True)
class Model:
    """Named quantities plus equations; building it compiles nothing and takes milliseconds.

    Attributes `dae`, `ode`, `tangent` and `decay` are CasADi functions of `(t, x, u, p[, z])`:

    ========= ============================================= ==========================================
    function  arguments                                     results
    ========= ============================================= ==========================================
    `dae`     t, x (nx,), u (nu,), p (np,), z (nz,)         dx/dt (nx,), residual (nz,), y (ny,), s (ns,)
    `ode`     t, x, u, p                                    dx/dt, y, s, z, with z solved inside
    `tangent` t, x, u, p, z, dx (nx,), dp (np,)             derivatives of dx/dt, y and decay along (dx, dp)
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
        raise ModelError(f"model '{self.name}' has no {name!r} among its {kind}; {near_match(name, self.names(kind))}")

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
            i = self.index("parameters", name)
            p = new[i]
            if not (np.isfinite(value) and p.lower <= value <= p.upper):
                raise RangeError(
                    f"parameter {p.name!r} = {value:g} {p.unit} is outside its physical range "
                    f"[{p.lower:g}, {p.upper:g}] {p.unit}; give a value inside it"
                )
            new[i] = replace(p, value=float(value))
        return replace(self, parameters=tuple(new))

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

    @property
    def tangent(self) -> ca.Function:
        """Directional derivative of the right-hand side and the outputs, with z moving along; see the class."""
        return self._built.tangent

    @property
    def decay(self) -> ca.Function:
        """Decay rates of the fast states, see the class."""
        return self._built.decay

    @property
    def sites(self) -> tuple[str, ...]:
        """Names of the sites that the equations pass through."""
        return self._built.sites

    @cached_property
    def _built(self) -> _Built:
        return _build(self)


@dataclass(frozen=True)
class _Built:
    dae: ca.Function
    ode: ca.Function
    tangent: ca.Function
    decay: ca.Function
    sites: tuple[str, ...]


def _collect(what: str, declared: Sequence[str], given: Mapping[str, ca.SX], model: str) -> ca.SX:
    missing = [n for n in declared if n not in given]
    extra = [n for n in given if n not in declared]
    if missing or extra:
        problem = f"{what} not given: {', '.join(missing)}" if missing else f"{what} not declared: {', '.join(extra)}"
        raise ModelError(f"model '{model}': {problem}; declare and give each of them once")
    return ca.vertcat(*(given[n] for n in declared)) if declared else ca.SX(0, 1)


def _build(model: Model) -> _Built:
    kinds: tuple[Kind, ...] = ("states", "inputs", "parameters", "algebraic")
    symbols: dict[Kind, dict[str, ca.SX]] = {k: {n: ca.SX.sym(n) for n in model.names(k)} for k in kinds}
    t = ca.SX.sym("t")
    scope = Scope(symbols, t)
    model.equations(scope)

    x, u, p, z = (ca.vertcat(*symbols[k].values()) if symbols[k] else ca.SX(0, 1) for k in kinds)
    rates = _collect("derivatives", model.names("states"), scope.derivatives, model.name)
    outputs = _collect("outputs", model.names("outputs"), scope.outputs, model.name)
    signals = _collect("signals", model.names("signals"), scope.signals, model.name)
    residuals = {n: r for n, (r, _) in scope.residuals.items()}
    residual = _collect("residuals", model.names("algebraic"), residuals, model.name)

    options = {"cse": True}
    dae = ca.Function(
        "dae",
        [t, x, u, p, z],
        [rates, residual, outputs, signals],
        ["t", "x", "u", "p", "z"],
        ["xdot", "residual", "y", "s"],
        options,
    )
    value = ca.vertcat(*(scope.residuals[n][1] for n in model.names("algebraic")))
    if model.algebraic:
        newton = ca.Function("newton", [t, x, u, p, z], [residual, ca.jacobian(residual, z)], options)
        for _ in range(NEWTON_STEPS):
            f, slope = newton(t, x, u, p, value)
            value = value - (f / slope if len(model.algebraic) == 1 else ca.solve(slope, f))
    else:
        value = ca.SX(0, 1)
    xdot, _, y, s = dae(t, x, u, p, value)
    ode = ca.Function("ode", [t, x, u, p], [xdot, y, s, value], ["t", "x", "u", "p"], ["xdot", "y", "s", "z"], options)
    rates_of_decay = ca.vertcat(*(scope.decays.get(n, ca.SX(0)) for n in model.names("states")))
    decay = ca.Function("decay", [t, x, u, p, z], [ca.densify(rates_of_decay)], options)
    return _Built(dae, ode, _tangent(dae, decay), decay, tuple(scope.sites))


def _tangent(dae: ca.Function, decay: ca.Function) -> ca.Function:
    t, x, u, p, z = dae.sx_in()
    dx, dp = ca.SX.sym("dx", x.numel()), ca.SX.sym("dp", p.numel())
    rates, residual, y, _ = dae(t, x, u, p, z)
    known, direction = ca.vertcat(x, p), ca.vertcat(dx, dp)
    if z.numel():
        slope = ca.jacobian(residual, z)
        moved = ca.jtimes(residual, known, direction)
        dz = -moved / slope if z.numel() == 1 else -ca.solve(slope, moved)
    else:
        dz = ca.SX(0, 1)
    both = ca.vertcat(rates, y, decay(t, x, u, p, z))
    change = ca.jtimes(both, ca.vertcat(known, z), ca.vertcat(direction, dz))
    nx = x.numel()
    return ca.Function(
        "tangent",
        [t, x, u, p, z, dx, dp],
        [change[:nx], change[nx:-nx], change[-nx:]],
        ["t", "x", "u", "p", "z", "dx", "dp"],
        ["dxdot", "dy", "ddecay"],
        {"cse": True},
    )
