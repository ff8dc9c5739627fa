"""Where everything lies in the vectors of the optimal control problem: variables, constraints, scales, bounds.

The order is the one fatrop needs: x0, u0, x1, u1, ..., where x holds the states and the moved inputs before, and u the
moved inputs, the slacks of the grade limit and of the level range, and the collocation points of the stage.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adaptive_flot.greybox.model import FloatArray, Model

DEGREE = 2
"""Of the Radau collocation: the last of its points is the end of the move."""
MOVED = ("air_flow", "level_setpoint")
"""Inputs that the controller moves; the others are disturbances, held over the horizon."""
SLACKS = 2
"""A stage has one slack of the grade limit and one of the level range."""
LEVEL_SLACK_SCALE = 0.01
"""m. A drop of the feed pulls the level below its range whatever is done: the range is soft, and never the reason for a
problem without a solution."""
MOVE_SCALE = {"air_flow": 1e-3, "level_setpoint": 0.1}

Multipliers = tuple[FloatArray, FloatArray]
"""Of the bounds (n,) and of the constraints (m,), positive at upper ones (as CasADi has them)."""


@dataclass(frozen=True)
class Bounds:
    """Ranges of the moved inputs (2, 2), their largest move an interval (2,), and of the level (2,), in SI units."""

    inputs: FloatArray
    moves: FloatArray
    level: FloatArray


class Layout:
    """Indices, scales and bounds of the problem of one model, horizon and move length.

    Attributes
    ----------
    state_size, control_size, block, size
        Lengths of x, of u, of a stage (x and u together) and of all variables.
    chosen, points
        Where the moved inputs and slacks lie in a stage, and where its collocation points begin.
    rows
        Constraints by kind, one line a stage: `gap` (to the next stage), `initial` (of the first stage only),
        `equations` (of the collocation points), `moves`, `grade`, `level`.
    """

    def __init__(self, model: Model, horizon: int, move_s: float) -> None:
        self.model, self.horizon, self.move_s = model, horizon, move_s
        self.moved = model.indices("inputs", MOVED)
        self.x_scale = np.array([q.scale for q in model.states])
        self.z_scale = np.array([q.scale for q in model.algebraic])
        self.u_scale = np.array([MOVE_SCALE[name] for name in MOVED])
        self.state_size = len(model.states) + len(MOVED)
        self.chosen = slice(self.state_size, self.state_size + len(MOVED) + SLACKS)
        self.points = self.chosen.stop
        self.control_size = len(MOVED) + SLACKS + DEGREE * self.point_size
        self.block = self.state_size + self.control_size
        self.size = horizon * self.block + self.state_size
        self.rows = self._rows()

    @property
    def point_size(self) -> int:
        """Variables of a collocation point: states and algebraic variables."""
        return len(self.model.states) + len(self.model.algebraic)

    def point(self, j: int) -> int:
        """Where collocation point j begins in its stage."""
        return self.points + j * self.point_size

    def _rows(self) -> dict[str, NDArray[np.intp]]:
        sizes = {
            "gap": self.state_size,
            "initial": self.state_size,
            "equations": DEGREE * self.point_size,
            "moves": len(MOVED),
            "grade": DEGREE,
            "level": DEGREE,
        }
        rows: dict[str, list[NDArray[np.intp]]] = {kind: [] for kind in sizes}
        begin = 0
        for k in range(self.horizon):
            for kind, size in sizes.items():
                if kind == "initial" and k > 0:
                    continue
                rows[kind].append(np.arange(begin, begin + size))
                begin += size
        return {kind: np.array(lines) for kind, lines in rows.items()}

    @property
    def stage_rows(self) -> NDArray[np.intp]:
        """Constraints of each stage, without the initial condition (horizon, rows of a stage)."""
        return np.hstack([rows for kind, rows in self.rows.items() if kind != "initial"])

    # -- solutions -------------------------------------------------------------------------------------------------

    def stages(self, vector: FloatArray) -> FloatArray:
        """The stages of a vector of variables (horizon, block), without the last state; a view."""
        return vector[: self.horizon * self.block].reshape(self.horizon, self.block)

    def inputs_of(self, solution: FloatArray) -> FloatArray:
        """Moved inputs of the plan (horizon, 2) in SI units."""
        begin = self.chosen.start
        return np.asarray(self.stages(solution)[:, begin : begin + len(MOVED)] * self.u_scale)

    def shifted(self, solution: FloatArray) -> FloatArray:
        """The plan one move later, its last stage repeated: the next start."""
        moved = solution.copy()
        self.stages(moved)[:-1] = self.stages(solution)[1:]
        return moved

    def shifted_multipliers(self, multipliers: Multipliers) -> Multipliers:
        """Multipliers for the plan one move later; those of the initial condition are kept."""
        bounds, constraints = multipliers
        moved = constraints.copy()
        for rows in self.rows.values():
            moved[rows[:-1]] = constraints[rows[1:]]
        return self.shifted(bounds), moved

    def start(self, state: FloatArray, inputs: FloatArray, algebraic: FloatArray) -> FloatArray:
        """Cold start: everything stays as it is. State (nx,), moved inputs (2,), algebraic variables (nz,)."""
        x, u, z = state / self.x_scale, inputs / self.u_scale, algebraic / self.z_scale
        points = np.concatenate([np.concatenate([x, z])] * DEGREE)
        stage = np.concatenate([x, u, u, np.zeros(SLACKS), points])
        return np.concatenate([*[stage] * self.horizon, x, u])

    # -- bounds ----------------------------------------------------------------------------------------------------

    def bounds(self, bounds: Bounds) -> dict[str, FloatArray]:
        """Arguments lbx, ubx, lbg, ubg for a solver.

        The physical ranges of the states are not among them: the equations keep them by themselves, and each bound
        makes an interior-point iteration dearer. `physical` is what a solution is verified against.
        """
        free = np.array([-np.inf, np.inf])
        x = np.tile(free, (self.state_size, 1))
        u = bounds.inputs / self.u_scale[:, None]
        z = np.array([[max(q.lower, 1e-3 * q.scale) / q.scale, np.inf] for q in self.model.algebraic]).reshape(-1, 2)
        point = np.vstack([np.tile(free, (len(self.model.states), 1)), z])
        stage = np.vstack([x, u, [[0.0, np.inf], free], *[point] * DEGREE])
        variables = np.vstack([*[stage] * self.horizon, x])
        g = np.zeros((sum(rows.size for rows in self.rows.values()), 2))
        move = np.asarray(bounds.moves) / self.u_scale
        g[self.rows["moves"]] = np.stack([-move, move], axis=1)
        g[self.rows["grade"]] = [0.0, np.inf]
        g[self.rows["level"]] = np.asarray(bounds.level) / LEVEL_SLACK_SCALE
        return {"lbx": variables[:, 0], "ubx": variables[:, 1], "lbg": g[:, 0], "ubg": g[:, 1]}

    def physical(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest value (n,) that each variable can have in the model; a measured state may lie outside."""
        point = np.array([[q.lower, q.upper] for q in (*self.model.states, *self.model.algebraic)])
        point /= np.concatenate([self.x_scale, self.z_scale])[:, None]
        ranges = np.tile([-np.inf, np.inf], (self.size, 1))
        for k in range(self.horizon):
            begin = k * self.block + self.points
            ranges[begin : begin + DEGREE * self.point_size] = np.tile(point, (DEGREE, 1))
        return ranges[:, 0], ranges[:, 1]
