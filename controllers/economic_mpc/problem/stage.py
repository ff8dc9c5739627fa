"""One stage of the optimal control problem: the move that is made, and the model's DAE at two collocation points.

Radau collocation of degree 2 keeps the DAE exact at the collocation points. Algebraic variables stay variables with
their own equations: Newton iterations inside the right-hand side would be half as fast. All stages are alike:
everything is built for one and evaluated for all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from adaptive_flot.contracts import Economics, OperatingPoint
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.sensors import without_sensor_effects
from controllers.economic_mpc.problem.layout import DEGREE, StageLayout


def control_prices(layout: StageLayout) -> int:
    """Number of prices of the controller itself, behind those of the economics: of moves, and of each slack."""
    return 1 + layout.slacks_size


@dataclass(frozen=True)
class OutputModifiers:
    """Corrections of outputs: ``offsets + slopes (a - answered)``; a is the input that outputs have answered to.

    Attributes
    ----------
    offsets
        Of each output, for the economics (ny,). Limited outputs have the biases of `Arguments` instead.
    slopes
        Each in the unit of its output over that of its input (ny, m).
    answered
        Moved inputs that the offsets hold for (m,).
    """

    offsets: FloatArray
    slopes: FloatArray
    answered: FloatArray

    def parts(self) -> list[FloatArray]:
        """All of it, in the order of the NLP's parameters; slopes by output."""
        return [self.offsets, self.slopes.ravel(), self.answered]


@dataclass(frozen=True)
class Arguments:
    """What may change from solve to solve without a rebuild.

    Attributes
    ----------
    state
        Model state now (nx,).
    previous
        Moved inputs of the last interval (m,).
    parameters
        Parameter vector (np,): the newest estimate inside.
    disturbances
        The other inputs (nu - m,).
    limits
        Value of each output limit, in the order of `StageLayout.output_limits`.
    biases
        Added to every prediction of a limited output: what the model is off by now, in the order of
        `StageLayout.outputs`.
    prices
        Those of the economics; then the cost of a squared scaled move, the penalty on a second of the slack of each
        output limit, and that on a second of the squared slack of each limited state.
    time
        Time now [s], for a model that depends on it.
    modifiers
        Of a modified layout: corrections of all outputs.
    """

    state: FloatArray
    previous: FloatArray
    parameters: FloatArray
    disturbances: FloatArray
    limits: FloatArray
    biases: FloatArray
    prices: FloatArray
    time: float = 0.0
    modifiers: OutputModifiers | None = None

    def vector(self) -> FloatArray:
        """All of it, in the order of the NLP's parameters."""
        situation = [self.state, self.previous, self.parameters, self.disturbances, [self.time]]
        own = [] if self.modifiers is None else self.modifiers.parts()
        return np.concatenate([*situation, self.limits, self.biases, self.prices, *own])


@dataclass(frozen=True)
class ArgumentSymbols:
    """The arguments as symbols: `vector` is all of them, in the order of `Arguments.vector`; slopes (ny * m,)."""

    vector: ca.SX
    state: ca.SX
    previous: ca.SX
    parameters: ca.SX
    disturbances: ca.SX
    time: ca.SX
    limits: ca.SX
    biases: ca.SX
    prices: ca.SX
    offsets: ca.SX | None = None
    slopes: ca.SX | None = None
    answered: ca.SX | None = None

    @classmethod
    def of(cls, layout: StageLayout, prices: int) -> ArgumentSymbols:
        """Symbols for a layout and a number of prices."""
        model, m = layout.model, layout.inputs_size
        sizes = [len(model.states), m, len(model.parameters), len(model.inputs) - m, 1]
        sizes += [len(layout.output_limits), len(layout.outputs), prices]
        if layout.answer_s is not None:
            ny = len(model.outputs)
            sizes += [ny, ny * m, m]
        p = ca.SX.sym("p", sum(sizes))
        return cls(p, *ca.vertsplit(p, list(np.cumsum([0, *sizes]))))


@dataclass
class Stage:
    """Expressions of one stage, with the rows of `StageLayout.rows` but without the initial condition.

    Attributes
    ----------
    variables, after, begin
        Symbols of the stage's variables (block,), of the next stage's x (state_size,) and of the time between now and
        the stage's begin [s].
    arguments
        Symbols of the arguments.
    constraints, names
        Constraints and a name for each.
    terms
        What is earned: terms of the economics, moves, slacks of the output limits and of the states.
    economic_terms
        Number of the terms that are those of the economics, the first ones.
    outputs
        Limited outputs at the end of the stage, bias included.
    """

    variables: ca.SX
    after: ca.SX
    begin: ca.SX
    arguments: ArgumentSymbols
    constraints: ca.SX
    names: list[str]
    terms: ca.SX
    economic_terms: int
    outputs: ca.SX


@dataclass
class _Written:
    earned: dict[str, ca.SX]
    constraints: list[ca.SX] = field(default_factory=list)
    names: list[str] = field(default_factory=list)

    def constrain(self, expression: ca.SX, names: Sequence[str]) -> None:
        self.constraints.append(expression)
        self.names += names


def write_stage(layout: StageLayout, economics: Economics) -> Stage:
    """Write the stage of a model that earns and costs what `economics` says.

    Raises
    ------
    ModelError
        The rates of the economics are not those of its terms.
    """
    model, begin = layout.model, ca.SX.sym("begin")
    p = ArgumentSymbols.of(layout, len(economics.prices()) + control_prices(layout))
    w = _Written(dict.fromkeys(economics.terms, ca.SX(0.0)))
    nx, nz, nu = len(model.states), len(model.algebraic), layout.inputs_size
    variables, after = ca.SX.sym("w", layout.block), ca.SX.sym("after", layout.state_size)
    sizes = [nx, nu, layout.answered_size, nu, len(layout.output_limits), len(layout.states), *[nx, nz] * DEGREE]
    x, before, answered, u, beyond_limits, off_ranges, *rest = ca.vertsplit(variables, list(np.cumsum([0, *sizes])))
    points = [(rest[2 * j], rest[2 * j + 1]) for j in range(DEGREE)]
    correction = _Correction(layout, p, answered, u)
    continuing = [*model.names("states"), *layout.moved_names]
    continuing += [f"answer to {name}" for name in layout.moved_names[: layout.answered_size]]
    w.constrain(after - ca.vertcat(points[-1][0], u, correction.answered(1.0)), [f"{n} continues" for n in continuing])
    outputs = _dae(w, _Process(layout, p, begin), economics, x, u, points, correction)
    w.constrain(u - before, [f"move of {name}" for name in layout.moved_names])
    for j, expected in enumerate(outputs):  # a move may act at once and later: both points count
        for i, end in enumerate(layout.output_limits):
            value, limit = expected[layout.outputs.index(end.output)], p.limits[i]
            inside = limit - value if end.is_upper else value - limit
            w.constrain(inside / layout.output_slack_scale[i] + beyond_limits[i], [f"{end.name}, point {j + 1}"])
    for j, (xj, _) in enumerate(points):
        for i, name in enumerate(layout.states):
            index = model.index("states", name)
            scaled = xj[index] * layout.x_scale[index] / layout.state_slack_scale[i]
            w.constrain(scaled + off_ranges[i], [f"range of {name}, point {j + 1}"])
    move_cost, *penalties = ca.vertsplit(p.prices[-control_prices(layout) :])
    terms = [*w.earned.values(), -move_cost * ca.sumsqr(u - before)]
    costs = [*ca.vertsplit(beyond_limits), *(slack**2 for slack in ca.vertsplit(off_ranges))]
    terms += [-penalty * layout.move_s * cost for penalty, cost in zip(penalties, costs, strict=True)]
    constraints = ca.vertcat(*w.constraints)
    return Stage(
        variables, after, begin, p, constraints, w.names, ca.vertcat(*terms), len(economics.terms), outputs[-1]
    )


def _dae(
    w: _Written,
    process: _Process,
    economics: Economics,
    x: ca.SX,
    u: ca.SX,
    points: Sequence[tuple[ca.SX, ca.SX]],
    correction: _Correction,
) -> list[ca.SX]:
    """Write the DAE at each collocation point and what is earned there; return the limited outputs, bias included."""
    model, layout, p = process.model, process.layout, process.arguments
    taus = ca.collocation_points(DEGREE, "radau")
    coefficients = ca.collocation_coeff(taus)
    slopes, weights = np.array(coefficients[0]), np.array(coefficients[2]).ravel()
    held = ca.SX(len(model.inputs), 1)
    held[layout.moved] = u * layout.u_scale
    held[[i for i in range(len(model.inputs)) if i not in layout.moved]] = p.disturbances
    limited = model.indices("outputs", layout.outputs)
    outputs = []
    for j, (xj, zj) in enumerate(points):
        rates, residual, point = process.at(taus[j], xj, held, zj)
        slope = slopes[0, j] * x + sum(slopes[r + 1, j] * points[r][0] for r in range(DEGREE))
        w.constrain(slope - layout.move_s * rates / layout.x_scale, [f"d{n}/dt" for n in model.names("states")])
        w.constrain(residual / layout.z_scale, list(model.names("algebraic")))
        earned = economics.rates(correction.for_economics(point, taus[j]), p.prices)
        if set(earned) != set(economics.terms):
            raise ModelError(
                f"the rates of the economics are {list(earned)}, its terms {list(economics.terms)}; give both alike"
            )
        for name, rate in earned.items():
            w.earned[name] += weights[j] * layout.move_s * rate
        outputs.append(correction.for_limits(point.outputs, limited, taus[j]))
    return outputs


class _Correction:
    """What is added to the outputs of a model during a move; inputs `answered` (m,) at its begin, u (m,), scaled."""

    def __init__(self, layout: StageLayout, arguments: ArgumentSymbols, answered: ca.SX, u: ca.SX) -> None:
        self._layout, self._p, self._begin, self._u = layout, arguments, answered, u

    def answered(self, tau: float) -> ca.SX:
        """Inputs that outputs have answered to in the move's part tau (m,), scaled; empty without modifiers."""
        if self._layout.answer_s is None:
            return self._begin
        left = float(np.exp(-tau * self._layout.move_s / self._layout.answer_s))
        return self._u + left * (self._begin - self._u)

    def for_limits(self, outputs: ca.SX, limited: Sequence[int], tau: float) -> ca.SX:
        """The limited outputs, bias included."""
        return (outputs + self._by_slopes(tau))[limited] + self._p.biases

    def for_economics(self, point: OperatingPoint, tau: float) -> OperatingPoint:
        """What is earned by a model without modifiers is earned by the model alone."""
        if self._p.offsets is None:
            return point
        return replace(point, outputs=point.outputs + self._p.offsets + self._by_slopes(tau))

    def _by_slopes(self, tau: float) -> ca.SX | float:
        slopes, since = self._p.slopes, self._p.answered
        if slopes is None or since is None:
            return 0.0
        by_output = ca.reshape(slopes, self._layout.inputs_size, len(self._layout.model.outputs)).T
        return by_output @ (self.answered(tau) * self._layout.u_scale - since)


class _Process:
    """The DAE of a model, with its outputs as they are and not as an instrument with an offset shows them."""

    def __init__(self, layout: StageLayout, arguments: ArgumentSymbols, begin: ca.SX) -> None:
        self.model, self.layout, self.arguments, self.begin = layout.model, layout, arguments, begin
        self._true = without_sensor_effects(self.model)
        self._states = self.model.indices("states", self._true.names("states"))
        self._parameters = self.model.indices("parameters", self._true.names("parameters"))

    def at(self, tau: float, x: ca.SX, held: ca.SX, z: ca.SX) -> tuple[ca.SX, ca.SX, OperatingPoint]:
        """Rates, residual and operating point in the move's part tau; x (nx,) and z (nz,) scaled, inputs not."""
        layout, theta = self.layout, self.arguments.parameters
        t = self.arguments.time + self.begin + tau * layout.move_s
        state, z = x * layout.x_scale, z * layout.z_scale
        rates, residual, y, _ = self.model.dae(t, state, held, theta, z)
        if self._true is not self.model:  # limits and prices hold for the product, not for what is shown
            y = self._true.dae(t, state[self._states], held, theta[self._parameters], z)[2]
        return rates, residual, OperatingPoint(self.model, state, held, y, theta)
