"""Where everything lies in the vectors of a scenario tree: variables, constraints, bounds, starts.

All scenarios stand one behind the other as a single chain of stages, in the order that fatrop factorises in linear
time. Where one ends, the next state is the state now, whatever came before. The first move is carried along the chain
as m further states, so that every branch can be held to it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.problem.derivatives import IntArray
from controllers.economic_mpc.problem.layout import DEGREE, Multipliers, StageLayout


class TreeLayout:
    """Indices of the stages of a tree in its vectors.

    Parameters
    ----------
    layout
        Of the nominal plan.
    stage_names
        Names of the constraints of a stage.
    count
        Number S of scenarios, the nominal one first.
    branch
        Moves of a branch, at most those of the horizon.

    Attributes
    ----------
    size, rows
        Numbers of variables and of constraints.
    length
        Number L of stages of all scenarios.
    scenario, move
        Of each stage (L,).
    first, last
        Whether a stage begins a scenario, and whether another scenario follows it (L,).
    ends
        Which variables of a stage are state and inputs at its end (state_size,).
    columns, stage_rows
        Where the variables and the constraints of each stage stand (L, block), (L, rows of a stage).
    start
        Rows of the initial condition (state_size,).
    names, equality
        Of the constraints.
    structure
        Options of fatrop that say where the stages lie.
    """

    def __init__(self, layout: StageLayout, stage_names: list[str], count: int, branch: int) -> None:
        self.layout, self.count, self._stage_names = layout, count, stage_names
        n, m = layout.state_size, layout.inputs_size
        self.moves = np.array([layout.horizon] + [branch] * (count - 1))
        self.length = int(self.moves.sum())
        self.scenario = np.repeat(np.arange(count), self.moves)
        self.move = np.concatenate([np.arange(moves) for moves in self.moves])
        self.first = self.move == 0
        self.last = np.roll(self.first, -1)
        self.last[-1] = False  # nothing follows: its end is the end of the chain
        before, end = n - layout.answered_size, layout.point(DEGREE - 1)
        nx = before - m
        self.ends = np.concatenate([np.arange(end, end + nx), np.arange(n, n + m), np.arange(before, n)])
        carried = np.full(self.length, m)
        carried[0] = 0
        begin = np.concatenate([[0], np.cumsum(layout.block + carried)])
        self.size = int(begin[-1]) + n
        local = np.tile(np.arange(layout.block), (self.length, 1))
        self.columns: IntArray = begin[:-1, None] + local + np.where(local < n, 0, carried[:, None])
        self._next_x: IntArray = begin[1:, None] + np.arange(n)
        self._carry: IntArray = begin[1:-1, None] + n + np.arange(m)  # where stage k + 1 has the first move
        self._later = np.minimum(np.arange(self.length) + 1, np.repeat(np.cumsum(self.moves) - 1, self.moves))
        self._rows_of(carried)

    def _rows_of(self, carried: IntArray) -> None:
        """Rows of the gaps, of the first move handed on, of the start, of the moves held to it, and of the rest."""
        layout, of_stage = self.layout, self._stage_names
        n, m, others = layout.state_size, layout.inputs_size, len(of_stage) - layout.state_size
        self.stage_rows = np.zeros((self.length, n + others), dtype=np.intp)
        self._handed = np.zeros((self.length - 1, m), dtype=np.intp)
        held: list[IntArray] = []
        row, names, sizes = 0, [], []
        for k in range(self.length):
            self.stage_rows[k, :n] = row + np.arange(n)
            row += n
            if k < self.length - 1:
                self._handed[k] = row + np.arange(m)
                row += m
            begin, extra = row, n if k == 0 else (m if self.first[k] else 0)
            if k == 0:
                self.start = row + np.arange(n)
            elif self.first[k]:
                held.append(row + np.arange(m))
            row += extra
            self.stage_rows[k, n:] = row + np.arange(others)
            row += others
            where = f"scenario {self.scenario[k] + 1}, {self.move[k] * layout.move_s:g} s: "
            names += [where + name for name in of_stage[:n]]
            names += [where + "first move handed on"] * (m if k < self.length - 1 else 0)
            names += [where + ("start" if k == 0 else "the first move is that of all")] * extra
            names += [where + name for name in of_stage[n:]]
            sizes.append(row - begin)
        self._held = np.array(held, dtype=np.intp).reshape(-1, m)
        self.rows, self.names = row, names
        equal = np.ones(row, dtype=bool)
        points = DEGREE * layout.point_size
        equal[self.stage_rows[:, n + points :]] = False
        self.equality: list[bool] = equal.tolist()
        self.structure: dict[str, Any] = {
            "structure_detection": "manual",
            "N": self.length,
            "nx": [n, *(n + carried[1:]).tolist(), n],
            "nu": [layout.control_size] * self.length + [0],
            "ng": [*sizes, 0],
        }

    def ones(self) -> tuple[list[int], list[int], FloatArray]:
        """Entries of the Jacobian that are constant: rows, columns, values."""
        layout = self.layout
        n, m = layout.state_size, layout.inputs_size
        u = self.columns[:, n : n + m]
        handed_from = np.vstack([u[:1], self._carry[:-1]])
        held_to = self._carry[np.flatnonzero(self.first)[1:] - 1]
        parts = [
            (self.stage_rows[:, :n], self._next_x, 1.0),
            (self._handed, self._carry, 1.0),
            (self._handed, handed_from, -1.0),
            (self.start, self.columns[0, :n], 1.0),
            (self._held, u[self.first][1:], 1.0),
            (self._held, held_to, -1.0),
        ]
        rows, columns = (np.concatenate([part[i].ravel() for part in parts]) for i in (0, 1))  # type: ignore[union-attr]
        values = np.concatenate([np.full(part[0].size, part[2]) for part in parts])
        return rows.tolist(), columns.tolist(), values

    def stages_of(self, scenario: int) -> slice:
        """Stages of a scenario."""
        end = int(self.moves[: scenario + 1].sum())
        return slice(end - int(self.moves[scenario]), end)

    # -- vectors ---------------------------------------------------------------------------------------------------

    def joined(self, solutions: list[FloatArray]) -> FloatArray:
        """Variables of the tree (size,) from those of each scenario, as the nominal problem has them (n,) or longer."""
        return self.of_stages(
            np.concatenate([self.layout.stages(v)[:k] for v, k in zip(solutions, self.moves, strict=True)])
        )

    def of_stages(self, stages: FloatArray) -> FloatArray:
        """Variables of the tree (size,) from those of its stages (L, block)."""
        n, m = self.layout.state_size, self.layout.inputs_size
        x = np.zeros(self.size)
        x[self.columns] = stages
        x[self._carry] = stages[0, n : n + m]
        x[self._next_x[-1]] = stages[-1, self.ends]
        return x

    def shifted(self, x: FloatArray) -> FloatArray:
        """Each scenario one move later, its last stage repeated, with the first move of the nominal one."""
        stages = x[self.columns]
        n, m = self.layout.state_size, self.layout.inputs_size
        later = stages[self._later]
        later[self.first, n : n + m] = later[0, n : n + m]
        return self.of_stages(later)

    def shifted_multipliers(self, multipliers: Multipliers) -> Multipliers:
        """Multipliers for each scenario one move later."""
        bounds, constraints = (part.copy() for part in multipliers)
        bounds[self.columns] = bounds[self.columns][self._later]
        constraints[self.stage_rows] = constraints[self.stage_rows][self._later]
        return bounds, constraints

    def split(self, x: FloatArray) -> list[FloatArray]:
        """Variables of each scenario as the nominal problem has them; a branch repeats its last stage up to the end."""
        found = []
        for s in range(self.count):
            stages = x[self.columns[self.scenario == s]]
            stages = np.vstack([stages, *[stages[-1:]] * (self.layout.horizon - len(stages))])
            found.append(np.concatenate([stages.ravel(), stages[-1, self.ends]]))
        return found

    def bounds(self, plain: dict[str, FloatArray]) -> dict[str, FloatArray]:
        """Bounds of the tree from those of the nominal problem."""
        layout, found = self.layout, {}
        for key, empty in (("lbx", -np.inf), ("ubx", np.inf)):
            found[key] = np.full(self.size, empty)
            found[key][self.columns] = layout.stages(plain[key])[self.move]
        for key in ("lbg", "ubg"):
            found[key] = np.zeros(self.rows)
            found[key][self.stage_rows] = plain[key][layout.stage_rows][self.move]
        return found

    def physical(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest value of each variable, see `StageLayout.physical`."""
        low, high = (np.full(self.size, end) for end in (-np.inf, np.inf))
        for ends, own in zip((low, high), self.layout.physical(), strict=True):
            ends[self.columns] = self.layout.stages(own)[self.move]
        return low, high
