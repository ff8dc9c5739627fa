"""Where everything lies in the vectors of the optimal control problem: variables, constraints, scales, bounds.

The order is the one fatrop needs: x0, u0, x1, u1, ..., where x holds the states and the moved inputs before. With
modifiers it also holds the inputs that outputs have answered to. u holds the moved inputs, the slacks of the limited
outputs and of the limited states, and the collocation points of the stage.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adaptive_flot.contracts import Limits
from adaptive_flot.greybox.model import FloatArray, Model

DEGREE = 2
"""Of the Radau collocation: the last of its points is the end of the move."""
BACKOFF_PER_SCALE = 100
"""The default distance to a limit is a hundredth of the scale of its output."""
SLACKS_PER_SCALE = 10
"""A slack of 1 is a tenth of the scale of its output or state. Limits of outputs and states are soft: a disturbance may
pull a level below its range whatever is done, and that must not leave a problem without a solution."""

Multipliers = tuple[FloatArray, FloatArray]
"""Of the bounds (n,) and of the constraints (m,), positive at upper ones (as CasADi has them)."""


@dataclass(frozen=True)
class Bounds:
    """Limits as arrays: ranges of the m moved inputs (m, 2), their largest moves (m,), ranges of states (k, 2)."""

    inputs: FloatArray
    moves: FloatArray
    states: FloatArray

    @classmethod
    def of(cls, limits: Limits, layout: StageLayout) -> Bounds:
        """Limits in the order of a layout."""
        return cls(
            inputs=np.array([limits.inputs[name] for name in layout.moved_names]),
            moves=np.array([limits.moves[name] for name in layout.moved_names]),
            states=np.array([limits.states[name] for name in layout.states]).reshape(-1, 2),
        )


@dataclass(frozen=True)
class OutputLimit:
    """One finite end of an output's range: output by name and index, the end, and which one it is."""

    output: str
    index: int
    value: float
    is_upper: bool

    @property
    def name(self) -> str:
        """What messages call it."""
        return f"{'upper' if self.is_upper else 'lower'} limit of {self.output}"


class StageLayout:
    """Indices, scales and bounds of the problem of one model, its limits, horizon and move length.

    Attributes
    ----------
    answer_s
        Where outputs are corrected by modifiers (`modifiers/learning.py`): the time constant [s] with which they answer
        to inputs. None: there are no modifiers.
    answered_size
        Number of answered inputs in x: m with modifiers, else 0.
    moved
        Indices of the m inputs that the controller moves: those with a range, in the model's order. The others are
        disturbances, held over the horizon.
    outputs, output_limits
        Names of the limited outputs, and every finite end of their ranges.
    states
        Names of the k limited states.
    state_size, control_size, block, size
        Lengths of x, of u, of a stage (x and u together) and of all variables.
    chosen, points
        Where the moved inputs and slacks lie in a stage, and where its collocation points begin.
    rows
        Constraints by kind, one line a stage: `gap` (to the next stage), `initial` (of the first stage only),
        `equations` (of the collocation points), `moves`, `outputs` (their limits), `states` (their ranges).

    Raises
    ------
    ModelError
        A limit of a quantity that the model does not have.
    """

    def __init__(
        self, model: Model, limits: Limits, horizon: int, move_s: float, *, answer_s: float | None = None
    ) -> None:
        self.model, self.limits, self.horizon, self.move_s = model, limits, horizon, move_s
        self.answer_s = answer_s
        self.moved = sorted(model.indices("inputs", limits.inputs))
        self.moved_names = tuple(model.inputs[i].name for i in self.moved)
        self.outputs, self.states = tuple(limits.outputs), tuple(limits.states)
        self.output_limits = tuple(
            OutputLimit(name, model.index("outputs", name), value, is_upper)
            for name, ends in limits.outputs.items()
            for is_upper, value in zip((False, True), ends, strict=True)
            if np.isfinite(value)
        )
        self.x_scale = np.array([q.scale for q in model.states])
        self.z_scale = np.array([q.scale for q in model.algebraic])
        self.u_scale = np.array([model.inputs[i].scale for i in self.moved])
        self.output_slack_scale = [model.outputs[e.index].scale / SLACKS_PER_SCALE for e in self.output_limits]
        self.state_slack_scale = np.array(
            [model.states[i].scale / SLACKS_PER_SCALE for i in model.indices("states", self.states)]
        )
        self.inputs_size, self.slacks_size = len(self.moved), len(self.output_limits) + len(self.states)
        self.answered_size = 0 if answer_s is None else self.inputs_size
        self.state_size = len(model.states) + self.inputs_size + self.answered_size
        self.chosen = slice(self.state_size, self.state_size + self.inputs_size + self.slacks_size)
        self.points = self.chosen.stop
        self.control_size = self.inputs_size + self.slacks_size + DEGREE * self.point_size
        self.block = self.state_size + self.control_size
        self.size = horizon * self.block + self.state_size
        self.rows = self._rows()

    def with_horizon(self, horizon: int) -> StageLayout:
        """The same stages over another horizon."""
        return StageLayout(self.model, self.limits, horizon, self.move_s, answer_s=self.answer_s)

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
            "moves": self.inputs_size,
            "outputs": DEGREE * len(self.output_limits),
            "states": DEGREE * len(self.states),
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

    @property
    def inequalities(self) -> NDArray[np.intp]:
        """Those of moves, outputs and states of each stage (horizon, rows)."""
        return np.hstack([self.rows[kind] for kind in ("moves", "outputs", "states")])

    # -- solutions -------------------------------------------------------------------------------------------------

    def stages(self, vector: FloatArray) -> FloatArray:
        """The stages of a vector of variables (horizon, block), without the last state; a view."""
        return vector[: self.horizon * self.block].reshape(self.horizon, self.block)

    def inputs_of(self, solution: FloatArray) -> FloatArray:
        """Moved inputs of the plan (horizon, m), each in its unit."""
        begin = self.chosen.start
        return np.asarray(self.stages(solution)[:, begin : begin + self.inputs_size] * self.u_scale)

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
        """Cold start: everything stays as it is. State (nx,), moved inputs (m,), algebraic variables (nz,)."""
        x, u, z = state / self.x_scale, inputs / self.u_scale, algebraic / self.z_scale
        points = np.concatenate([np.concatenate([x, z])] * DEGREE)
        now = np.concatenate([x, u, u[: self.answered_size]])
        stage = np.concatenate([now, u, np.zeros(self.slacks_size), points])
        return np.concatenate([*[stage] * self.horizon, now])

    def limit_values(self, backoff: float | None) -> FloatArray:
        """Values of the output limits, moved inwards by a backoff in the output's unit; default see above."""
        outputs, ends = self.model.outputs, self.output_limits
        kept = [outputs[e.index].scale / BACKOFF_PER_SCALE if backoff is None else backoff for e in ends]
        return np.array([e.value - b if e.is_upper else e.value + b for e, b in zip(ends, kept, strict=True)])

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
        slacks = np.array([[0.0, np.inf]] * len(self.output_limits) + [free] * len(self.states)).reshape(-1, 2)
        stage = np.vstack([x, u, slacks, *[point] * DEGREE])
        variables = np.vstack([*[stage] * self.horizon, x])
        g = np.zeros((sum(rows.size for rows in self.rows.values()), 2))
        move = np.asarray(bounds.moves) / self.u_scale
        g[self.rows["moves"]] = np.stack([-move, move], axis=1)
        g[self.rows["outputs"]] = [0.0, np.inf]
        g[self.rows["states"]] = np.tile(bounds.states / self.state_slack_scale[:, None], (DEGREE, 1))
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
