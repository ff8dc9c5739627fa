"""One stage of the optimal control problem: the move that is made, and the cell's DAE at two collocation points.

Radau collocation of degree 2 keeps the DAE exact at the collocation points: the interfacial gas velocity stays an
algebraic variable with its own equation (Newton iterations inside the right-hand side would be half as fast). All
stages are alike: everything is built for one and evaluated for all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from adaptive_flot.economics import value_rates
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.sensors import without_sensor_effects
from controllers.economic_mpc.layout import DEGREE, LEVEL_SLACK_SCALE, MOVED, Layout

SLACK_SCALE = 0.01
"""Of the slack of the grade limit, which is so counted in percentage points."""
TERMS = ("metal", "treatment", "air", "reagent", "moves", "grade_slack", "level_slack")
"""What a stage earns (negative: costs), by name."""


@dataclass(frozen=True)
class Arguments:
    """What may change from solve to solve without a rebuild.

    Attributes
    ----------
    state
        Model state now (nx,).
    previous
        Moved inputs of the last interval (2,).
    parameters
        Parameter vector (np,): the newest estimate inside.
    disturbances
        The other inputs (nu - 2,).
    grade_limit
        Lowest grade allowed.
    grade_bias
        Added to every predicted grade: what the model is off by now.
    prices
        Metal, treatment, air, reagent; then the cost of a squared scaled move and the penalty on a scaled slack second
        (for the level: on its square).
    time
        Time now [s], for a model that depends on it.
    """

    state: FloatArray
    previous: FloatArray
    parameters: FloatArray
    disturbances: FloatArray
    grade_limit: float
    grade_bias: float
    prices: FloatArray
    time: float = 0.0

    def vector(self) -> FloatArray:
        """All of it, in the order of the NLP's parameters."""
        scalars = [self.time, self.grade_limit, self.grade_bias]
        return np.concatenate(
            [self.state, self.previous, self.parameters, self.disturbances, scalars, np.asarray(self.prices)]
        )


@dataclass(frozen=True)
class ArgumentSymbols:
    """The arguments as symbols: `vector` is all of them, in the order of `Arguments.vector`."""

    vector: ca.SX
    state: ca.SX
    previous: ca.SX
    parameters: ca.SX
    disturbances: ca.SX
    time: ca.SX
    grade_limit: ca.SX
    grade_bias: ca.SX
    prices: ca.SX

    @classmethod
    def of(cls, model: Model) -> ArgumentSymbols:
        """Symbols for a model."""
        sizes = [len(model.states), len(MOVED), len(model.parameters), len(model.inputs) - len(MOVED), 1, 1, 1, 6]
        p = ca.SX.sym("p", sum(sizes))
        return cls(p, *ca.vertsplit(p, list(np.cumsum([0, *sizes]))))


@dataclass
class Stage:
    """Expressions of one stage, with the rows of `Layout.rows` but without the initial condition.

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
        What is earned, in the order of `TERMS`.
    grade
        At the end of the stage, bias included.
    """

    variables: ca.SX
    after: ca.SX
    begin: ca.SX
    arguments: ArgumentSymbols
    constraints: ca.SX
    names: list[str]
    terms: ca.SX
    grade: ca.SX


@dataclass
class _Written:
    constraints: list[ca.SX] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    terms: dict[str, ca.SX] = field(default_factory=lambda: dict.fromkeys(TERMS, ca.SX(0.0)))

    def constrain(self, expression: ca.SX, names: Sequence[str]) -> None:
        self.constraints.append(expression)
        self.names += names


def write_stage(model: Model, layout: Layout) -> Stage:
    """Write the stage of a model."""
    p, w, begin = ArgumentSymbols.of(model), _Written(), ca.SX.sym("begin")
    nx, nz, nu = len(model.states), len(model.algebraic), len(MOVED)
    variables, after = ca.SX.sym("w", layout.block), ca.SX.sym("after", layout.state_size)
    sizes = [nx, nu, nu, 1, 1, *[nx, nz] * DEGREE]
    x, before, u, low_grade, off_level, *rest = ca.vertsplit(variables, list(np.cumsum([0, *sizes])))
    points = [(rest[2 * j], rest[2 * j + 1]) for j in range(DEGREE)]
    w.constrain(after - ca.vertcat(points[-1][0], u), [f"{n} continues" for n in (*model.names("states"), *MOVED)])
    grades = _dae(w, _Cell(model, layout, p, begin), x, u, points)
    w.constrain(u - before, [f"move of {n}" for n in MOVED])
    for j, grade in enumerate(grades):  # a move acts on the grade at once and on the pulp later: both count
        w.constrain((grade - p.grade_limit) / SLACK_SCALE + low_grade, [f"grade limit, point {j + 1}"])
    level = model.index("states", "level")
    for j, (xj, _) in enumerate(points):
        height = xj[level] * layout.x_scale[level] / LEVEL_SLACK_SCALE
        w.constrain(height + off_level, [f"level range, point {j + 1}"])
    move_cost, penalty = p.prices[4], p.prices[5]
    w.terms["moves"] = -move_cost * ca.sumsqr(u - before)
    w.terms["grade_slack"] = -penalty * layout.move_s * low_grade
    w.terms["level_slack"] = -penalty * layout.move_s * off_level**2
    terms = ca.vertcat(*(w.terms[name] for name in TERMS))
    return Stage(variables, after, begin, p, ca.vertcat(*w.constraints), w.names, terms, grades[-1])


def _dae(w: _Written, cell: _Cell, x: ca.SX, u: ca.SX, points: Sequence[tuple[ca.SX, ca.SX]]) -> list[ca.SX]:
    """Write the DAE at each collocation point and what is earned there; return the grades."""
    model, layout, p = cell.model, cell.layout, cell.arguments
    taus = ca.collocation_points(DEGREE, "radau")
    coefficients = ca.collocation_coeff(taus)
    slopes, weights = np.array(coefficients[0]), np.array(coefficients[2]).ravel()
    held = ca.SX(len(model.inputs), 1)
    held[layout.moved] = u * layout.u_scale
    held[[i for i in range(len(model.inputs)) if i not in layout.moved]] = p.disturbances
    grades = []
    for j, (xj, zj) in enumerate(points):
        rates, residual, y = cell.at(taus[j], xj, held, zj)
        slope = slopes[0, j] * x + sum(slopes[r + 1, j] * points[r][0] for r in range(DEGREE))
        w.constrain(slope - layout.move_s * rates / layout.x_scale, [f"d{n}/dt" for n in model.names("states")])
        w.constrain(residual / layout.z_scale, list(model.names("algebraic")))
        for name, rate in _rates(model, y, held, p).items():
            w.terms[name] += weights[j] * layout.move_s * rate
        grades.append(y[model.index("outputs", "concentrate_grade")] + p.grade_bias)
    return grades


class _Cell:
    """The DAE of a model, with its outputs as they are and not as an analyser with an offset shows them."""

    def __init__(self, model: Model, layout: Layout, arguments: ArgumentSymbols, begin: ca.SX) -> None:
        self.model, self.layout, self.arguments, self.begin = model, layout, arguments, begin
        self._true = without_sensor_effects(model)
        self._states = model.indices("states", self._true.names("states"))
        self._parameters = model.indices("parameters", self._true.names("parameters"))

    def at(self, tau: float, x: ca.SX, held: ca.SX, z: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Rates, residual and true outputs in the move's part tau; x (nx,) and z (nz,) scaled, inputs not."""
        layout, theta = self.layout, self.arguments.parameters
        t = self.arguments.time + self.begin + tau * layout.move_s
        state, z = x * layout.x_scale, z * layout.z_scale
        rates, residual, y, _ = self.model.dae(t, state, held, theta, z)
        if self._true is not self.model:  # limit and prices hold for the concentrate, not for what is shown
            y = self._true.dae(t, state[self._states], held, theta[self._parameters], z)[2]
        return rates, residual, y


def _rates(model: Model, y: ca.SX, held: ca.SX, p: ArgumentSymbols) -> dict[str, ca.SX]:
    grade, recovery = (y[model.index("outputs", n)] for n in ("concentrate_grade", "recovery"))
    feed = next(i for i, q in enumerate(model.parameters) if q.name.startswith("feed_concentration."))
    air, feed_flow = (held[model.index("inputs", n)] for n in ("air_flow", "feed_flow"))
    return value_rates(grade, recovery, air, feed_flow, p.parameters[feed], p.prices)
