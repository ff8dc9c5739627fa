"""Economic optimal control of a process as one parametric NLP: direct collocation, stage by stage.

The stages are alike (`stage.py`): the functions of the NLP are those of one stage, mapped over all of them. Only one
stage is built, in some hundredths of a second for any horizon.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from adaptive_flot.contracts import Economics, Limits
from adaptive_flot.greybox.model import FloatArray, Model
from controllers.economic_mpc.problem.layout import StageLayout
from controllers.economic_mpc.problem.stage import write_stage

CSE = {"cse": True}
"""Evaluate common parts of an expression once."""


class OptimalControlProblem:
    """The NLP of one model, its economics and limits, horizon, move length and modifiers; built once.

    Attributes
    ----------
    layout
        Where everything lies in its vectors.
    stage
        The expressions of one stage.
    nlp
        Expressions for `casadi.nlpsol`: x, f, g, p.
    equality
        Which constraints are equations, for fatrop.
    structure
        Options of fatrop that say where the stages lie.
    names
        A name for each constraint, for messages.
    begin
        Time between now and the begin of each stage [s] (1, horizon).
    terms
        CasADi function (x, p) -> the cost terms over the horizon, in the order of `Stage.terms`.
    outputs
        CasADi function (x, p) -> limited outputs at the end of each move (horizon, outputs), bias included.
    constraints
        CasADi function (x, p) -> g.
    """

    def __init__(
        self,
        model: Model,
        economics: Economics,
        limits: Limits,
        horizon: int,
        move_s: float,
        *,
        answer_s: float | None = None,
    ) -> None:
        self.model = model
        self.layout = layout = StageLayout(model, limits, horizon, move_s, answer_s=answer_s)
        self.stage = stage = write_stage(layout, economics)
        x, p = ca.MX.sym("x", layout.size), ca.MX.sym("p", stage.arguments.vector.numel())
        variables, after = self.split(x)
        self.begin = ca.DM(move_s * np.arange(horizon)).T
        w, vector, begin = stage.variables, stage.arguments.vector, stage.begin
        value = ca.Function("stage_terms", [w, begin, vector], [stage.terms], CSE)
        terms = value.map("terms", "serial", horizon, [2], [0])(variables, self.begin, p)
        limited = ca.Function("stage_outputs", [w, begin, vector], [stage.outputs], CSE)
        outputs = limited.map("outputs", "serial", horizon, [2], [])(variables, self.begin, p)
        each = ca.Function("stage_constraints", [w, stage.after, begin, vector], [stage.constraints], CSE)
        lines = each.map("lines", "serial", horizon, [3], [])(variables, after, self.begin, p)
        g = self.joined(self.initial(x, p), lines)
        self.nlp: dict[str, Any] = {"x": x, "f": -ca.sum1(terms), "g": g, "p": p}
        self.terms = ca.Function("terms", [x, p], [terms])
        self.outputs = ca.Function("outputs", [x, p], [outputs.T], ["x", "p"], ["outputs"])
        self.constraints = ca.Function("constraints", [x, p], [g])
        self.names = self._names()
        equations = np.zeros(len(self.names), dtype=bool)
        for kind in ("gap", "initial", "equations"):
            equations[layout.rows[kind]] = True
        self.equality: list[bool] = equations.tolist()
        self.structure: dict[str, Any] = {"structure_detection": "auto"}

    def physical(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest value of each variable, see `StageLayout.physical`."""
        return self.layout.physical()

    def split(self, x: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Variables of the stages (block, horizon), and where each of them ends (state_size, horizon)."""
        layout = self.layout
        stages = ca.reshape(x[: layout.horizon * layout.block], layout.block, layout.horizon)
        last = x[layout.horizon * layout.block :]
        return stages, ca.horzcat(stages[: layout.state_size, 1:], last)

    def initial(self, x: ca.MX, p: ca.MX) -> ca.MX:
        """Residual of the initial condition (state_size,)."""
        return x[: self.layout.state_size] - self.now(p)

    def joined(self, initial: ca.MX, lines: ca.MX) -> ca.MX:
        """One vector of the initial condition and the other constraints of each stage (rows of a stage, horizon)."""
        gap = self.layout.state_size
        return ca.vertcat(lines[:gap, 0], initial, lines[gap:, 0], ca.vec(lines[:, 1:]))

    def now(self, p: ca.MX) -> ca.MX:
        """State, inputs before the first stage and those that outputs have answered to, scaled."""
        symbols, layout = self.stage.arguments, self.layout
        answered = ca.SX() if symbols.answered is None else symbols.answered / layout.u_scale
        now = ca.vertcat(symbols.state / layout.x_scale, symbols.previous / layout.u_scale, answered)
        return ca.Function("now", [symbols.vector], [now])(p)

    def _names(self) -> list[str]:
        gap, move_s = self.layout.state_size, self.layout.move_s
        lines = [[f"{name} at {k * move_s:g} s" for name in self.stage.names] for k in range(self.layout.horizon)]
        first = [name.replace(" continues at 0 s", " now") for name in lines[0][:gap]]
        return [*lines[0][:gap], *first, *lines[0][gap:], *(name for line in lines[1:] for name in line)]
