"""Economic optimal control of a flotation cell as one parametric NLP: direct collocation, stage by stage.

Radau collocation of degree 2 keeps the DAE exact at the collocation points: the interfacial gas velocity stays an
algebraic variable with its own equation (Newton iterations inside the right-hand side would be half as fast). The order
of variables and constraints is the one fatrop needs: x0, u0, x1, u1, ..., where u holds the moved inputs, the slacks of
the grade limit and of the level range and the collocation points of its stage, and x the states and the inputs before;
for each stage first the gap to the next, then its other constraints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from adaptive_flot.economics import value_rates
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.sensors import without_sensor_effects

DEGREE = 2
MOVED = ("air_flow", "level_setpoint")
"""Inputs that the controller moves; the others are disturbances, held over the horizon."""
SLACK_SCALE = 0.01
LEVEL_SLACK_SCALE = 0.01
"""m. A drop of the feed pulls the level below its range whatever is done: the range is soft, and never the reason for a
problem without a solution."""
MOVE_SCALE = {"air_flow": 1e-3, "level_setpoint": 0.1}


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
class Bounds:
    """Ranges of the moved inputs (2, 2), their largest move an interval (2,), and of the level (2,), in SI units."""

    inputs: FloatArray
    moves: FloatArray
    level: FloatArray


class Problem:
    """The NLP of one model, horizon and move length; built once.

    Attributes
    ----------
    nlp
        Expressions for `casadi.nlpsol`: x, f, g, p.
    equality
        Which constraints are equations, for fatrop.
    names
        A name for each constraint, for messages.
    terms
        CasADi function (x, p) -> the cost terms over the horizon, in the order of `term_names`.
    grades
        CasADi function (x, p) -> grade at the end of each move (horizon,), bias included.
    """

    term_names = ("metal", "treatment", "air", "reagent", "moves", "grade_slack", "level_slack")

    def __init__(self, model: Model, horizon: int, move_s: float) -> None:
        self.model = model
        self.horizon = horizon
        self.move_s = move_s
        self.moved = model.indices("inputs", MOVED)
        self.x_scale = np.array([q.scale for q in model.states])
        self.z_scale = np.array([q.scale for q in model.algebraic])
        self.u_scale = np.array([MOVE_SCALE[name] for name in MOVED])
        self._build()

    # -- layout ----------------------------------------------------------------------------------------------------

    @cached_property
    def stage_sizes(self) -> tuple[int, int]:
        """Lengths of x (states and previous inputs) and of u (inputs, slacks, collocation points) of a stage."""
        nx, nz, nu = len(self.model.states), len(self.model.algebraic), len(MOVED)
        return nx + nu, nu + 2 + DEGREE * (nx + nz)

    def inputs_of(self, solution: FloatArray) -> FloatArray:
        """Moved inputs of the plan (horizon, 2) in SI units."""
        nx, nu = self.stage_sizes
        stages = solution[: self.horizon * (nx + nu)].reshape(self.horizon, nx + nu)
        return np.asarray(stages[:, nx : nx + len(MOVED)] * self.u_scale)

    def shifted(self, solution: FloatArray) -> FloatArray:
        """The plan one move later, its last stage repeated: the next start."""
        block = sum(self.stage_sizes)
        moved = solution.copy()
        moved[: block * (self.horizon - 1)] = solution[block : block * self.horizon]
        return moved

    def start(self, state: FloatArray, inputs: FloatArray, algebraic: FloatArray) -> FloatArray:
        """Cold start: everything stays as it is. State (nx,), moved inputs (2,), algebraic variables (nz,)."""
        x, u, z = state / self.x_scale, inputs / self.u_scale, algebraic / self.z_scale
        points = np.concatenate([np.concatenate([x, z])] * DEGREE)
        stage = np.concatenate([x, u, u, [0.0, 0.0], points])
        return np.concatenate([*[stage] * self.horizon, x, u])

    def bounds(self, bounds: Bounds) -> dict[str, FloatArray]:
        """Arguments lbx, ubx, lbg, ubg for a solver."""
        states = np.array([[q.lower, q.upper] for q in self.model.states])
        states = np.where(np.isfinite(states), states, np.array([[-1e3, 1e3]]))
        x = states / self.x_scale[:, None]
        u = bounds.inputs / self.u_scale[:, None]
        z = np.array([[max(q.lower, 1e-3 * q.scale), 10 * q.scale] for q in self.model.algebraic])
        z = z / self.z_scale[:, None]
        stage = np.vstack([x, u, u, [[0.0, 1e3], [-1e3, 1e3]], *[x, z] * DEGREE])
        everything = np.vstack([*[stage] * self.horizon, x, u])
        first = len(x) + len(u)
        everything[:first] = [-1e6, 1e6]  # the initial condition is an equation: a measured state may lie outside
        moves = np.repeat(np.asarray(bounds.moves)[:, None] / self.u_scale[:, None], 2, axis=1) * [-1.0, 1.0]
        level = np.asarray(bounds.level) / LEVEL_SLACK_SCALE
        g = np.vstack([self._constraint_bounds(k, moves, level) for k in range(self.horizon)])
        return {"lbx": everything[:, 0], "ubx": everything[:, 1], "lbg": g[:, 0], "ubg": g[:, 1]}

    def _constraint_bounds(self, stage: int, moves: FloatArray, level: FloatArray) -> FloatArray:
        nx, nz, nu = len(self.model.states), len(self.model.algebraic), len(MOVED)
        equations = (nx + nu) * (2 if stage == 0 else 1) + DEGREE * (nx + nz)
        return np.vstack([np.zeros((equations, 2)), moves, [[0.0, 1e3]] * DEGREE, [level] * DEGREE])

    # -- construction ----------------------------------------------------------------------------------------------

    def _build(self) -> None:
        model = self.model
        nx, nz, nu, npar = len(model.states), len(model.algebraic), len(MOVED), len(model.parameters)
        others = len(model.inputs) - nu
        sizes = [nx, nu, npar, others, 1, 1, 1, 6]
        p = ca.SX.sym("p", sum(sizes))
        x_now, u_before, theta, disturbances, t_now, limit, bias, prices = ca.vertsplit(p, list(np.cumsum([0, *sizes])))
        taus = ca.collocation_points(DEGREE, "radau")
        coefficients = ca.collocation_coeff(taus)
        slopes, weights = np.array(coefficients[0]), np.array(coefficients[2]).ravel()

        variables: list[ca.SX] = []
        constraints: list[ca.SX] = []
        self.equality: list[bool] = []
        self.names: list[str] = []
        totals = {name: ca.SX(0.0) for name in self.term_names}
        ends: list[ca.SX] = []

        def constrain(expression: ca.SX, equation: bool, names: Sequence[str]) -> None:
            constraints.append(expression)
            self.equality += [equation] * len(names)
            self.names += names

        true = without_sensor_effects(model)
        true_states = model.indices("states", true.names("states"))
        true_parameters = model.indices("parameters", true.names("parameters"))
        states, moves, level = model.names("states"), list(MOVED), model.index("states", "level")
        x = ca.SX.sym("x_0", nx + nu)
        for k in range(self.horizon):
            u, slack, below = ca.SX.sym(f"u_{k}", nu), ca.SX.sym(f"slack_{k}"), ca.SX.sym(f"level_slack_{k}")
            points = [(ca.SX.sym(f"x_{k}_{j}", nx), ca.SX.sym(f"z_{k}_{j}", nz)) for j in range(DEGREE)]
            variables += [x, u, slack, below, *(v for point in points for v in point)]
            after = ca.SX.sym(f"x_{k + 1}", nx + nu)
            at = f"at {k * self.move_s:g} s"
            constrain(after - ca.vertcat(points[-1][0], u), True, [f"{n} continues {at}" for n in (*states, *moves)])
            if k == 0:
                now = ca.vertcat(x_now / self.x_scale, u_before / self.u_scale)
                constrain(x - now, True, [f"{n} now" for n in (*states, *moves)])
            held = self._inputs(u * self.u_scale, disturbances)
            grades = []
            for j, (xj, zj) in enumerate(points):
                t, state, z = t_now + (k + taus[j]) * self.move_s, xj * self.x_scale, zj * self.z_scale
                rates, residual, y, _ = model.dae(t, state, held, theta, z)
                if true is not model:  # limit and prices hold for the concentrate, not for what an analyser shows
                    y = true.dae(t, state[true_states], held, theta[true_parameters], z)[2]
                slope = slopes[0, j] * x[:nx] + sum(slopes[r + 1, j] * points[r][0] for r in range(DEGREE))
                constrain(slope - self.move_s * rates / self.x_scale, True, [f"d{n}/dt {at}" for n in states])
                constrain(residual / self.z_scale, True, [f"{n} {at}" for n in model.names("algebraic")])
                for name, rate in self._rates(y, held, theta, prices).items():
                    totals[name] += weights[j] * self.move_s * rate
                grades.append(y[model.index("outputs", "concentrate_grade")] + bias)
            constrain(u - x[nx:], False, [f"move of {n} {at}" for n in moves])
            for j, grade in enumerate(grades):  # a move acts on the grade at once and on the pulp later: both count
                constrain((grade - limit) / SLACK_SCALE + slack, False, [f"grade limit {at}, point {j + 1}"])
            ends.append(grades[-1])
            for j, (xj, _) in enumerate(points):
                height = xj[level] * self.x_scale[level] / LEVEL_SLACK_SCALE
                constrain(height + below, False, [f"level range {at}, point {j + 1}"])
            totals["moves"] -= prices[4] * ca.sumsqr(u - x[nx:])
            totals["grade_slack"] -= prices[5] * self.move_s * slack
            totals["level_slack"] -= prices[5] * self.move_s * below**2
            x = after
        variables.append(x)
        terms = ca.vertcat(*(totals[name] for name in self.term_names))
        self.nlp = {"x": ca.vertcat(*variables), "f": -ca.sum1(terms), "g": ca.vertcat(*constraints), "p": p}
        self.terms = ca.Function("terms", [self.nlp["x"], p], [terms])
        self.grades = ca.Function("grades", [self.nlp["x"], p], [ca.vertcat(*ends)])
        self.constraints = ca.Function("constraints", [self.nlp["x"], p], [self.nlp["g"]])

    def _inputs(self, moved: ca.SX, disturbances: ca.SX) -> ca.SX:
        held = ca.SX(len(self.model.inputs), 1)
        held[self.moved] = moved
        held[[i for i in range(len(self.model.inputs)) if i not in self.moved]] = disturbances
        return held

    def _rates(self, y: ca.SX, held: ca.SX, theta: ca.SX, prices: ca.SX) -> dict[str, ca.SX]:
        model = self.model
        grade, recovery = (y[model.index("outputs", n)] for n in ("concentrate_grade", "recovery"))
        feed = next(i for i, q in enumerate(model.parameters) if q.name.startswith("feed_concentration."))
        air, feed_flow = (held[model.index("inputs", n)] for n in ("air_flow", "feed_flow"))
        return value_rates(grade, recovery, air, feed_flow, theta[feed], prices)
