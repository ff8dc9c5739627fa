"""The same optimal control problem in do-mpc (a development-only dependency), as its manual shows.

Same model, horizon, Radau points, scales, prices, limits, penalties and ipopt tolerance. do-mpc counts a stage cost at
the begin of a move only: what is earned is a further state here, so that both integrate it over the move. Limits of
moves are added with `prepare_nlp`, since it has none.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import casadi as ca
import numpy as np

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.processes.flotation.economics import Prices, value_rates
from adaptive_flot.runner.scenario.scenario import Scenario

MOVED = ("air_flow", "level_setpoint")
MOVE_SCALE = {"air_flow": 1e-3, "level_setpoint": 0.1}
SLACK_SCALE = LEVEL_SLACK_SCALE = 0.01
VALUE_SCALE = 1 / Prices.typical_rate
HORIZON, MOVE_S, BACKOFF, MOVE_COST, PENALTY, TOLERANCE = 20, 30.0, 1e-3, 1e-3, 1e-3, 1e-5


class DoMpc:
    """do-mpc's controller for the cell of a scenario."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario, self.cell = scenario, scenario.model
        self.model = self._model()
        self.mpc = self._controller()
        self._started = False

    def _model(self) -> Any:
        cell, prices = self.cell, self.scenario.prices
        assert prices is not None
        model = import_module("do_mpc").model.Model("continuous", "SX")
        x = ca.vertcat(*(model.set_variable("_x", q.name) for q in cell.states))
        model.set_variable("_x", "earned")
        u = {name: model.set_variable("_u", name) for name in MOVED}
        z = ca.vertcat(*(model.set_variable("_z", q.name) for q in cell.algebraic))
        p = ca.vertcat(*(model.set_variable("_p", f"p{i}") for i in range(len(cell.parameters))))
        others = {q.name: model.set_variable("_p", q.name) for q in cell.inputs if q.name not in MOVED}
        held = ca.vertcat(*({**u, **others}[q.name] for q in cell.inputs))
        rates, residual, y, _ = cell.dae(0.0, x, held, p, z)
        for i, q in enumerate(cell.states):
            model.set_rhs(q.name, rates[i])
        model.set_alg("loop", residual / np.array([q.scale for q in cell.algebraic]))
        grade, recovery = (y[cell.index("outputs", name)] for name in ("concentrate_grade", "recovery"))
        rich = p[cell.index("parameters", "feed_concentration.chalcopyrite")]
        scaled = [VALUE_SCALE * price for price in prices.prices()]
        earned = value_rates(grade, recovery, u["air_flow"], others["feed_flow"], rich, scaled)
        model.set_rhs("earned", sum(earned.values()))
        model.set_expression("grade", grade)
        model.setup()
        return model

    def _controller(self) -> Any:
        cell, limits = self.cell, self.scenario.limits
        assert limits is not None
        mpc = import_module("do_mpc").controller.MPC(self.model)
        mpc.settings.n_horizon, mpc.settings.t_step, mpc.settings.n_robust = HORIZON, MOVE_S, 0
        mpc.settings.collocation_deg, mpc.settings.collocation_ni = 2, 1
        mpc.settings.store_full_solution = False
        mpc.settings.nl_cons_check_colloc_points = True
        quiet = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": 0, "ipopt.tol": TOLERANCE}
        mpc.settings.nlpsol_opts = quiet
        for q in (*cell.states, *cell.algebraic):
            mpc.scaling["_x" if q in cell.states else "_z", q.name] = q.scale
        for q in cell.algebraic:
            mpc.bounds["lower", "_z", q.name] = max(q.lower, 1e-3 * q.scale)
        mpc.scaling["_x", "earned"] = 100.0
        mpc.set_objective(mterm=-self.model.x["earned"], lterm=ca.SX(0))
        mpc.set_rterm(**dict.fromkeys(MOVED, VALUE_SCALE * MOVE_COST))  # of scaled inputs
        below = (limits.outputs["concentrate_grade"][0] + BACKOFF - self.model.aux["grade"]) / SLACK_SCALE
        weight = VALUE_SCALE * PENALTY * MOVE_S
        mpc.set_nl_cons("grade", below, ub=0, soft_constraint=True, penalty_term_cons=weight)
        level, (low, high) = self.model.x["level"], limits.states["level"]
        for name, off in (("low", low - level), ("high", level - high)):
            off = off / LEVEL_SLACK_SCALE
            mpc.set_nl_cons(name, off, ub=0, soft_constraint=True, penalty_term_cons=weight)
        for name in MOVED:
            mpc.scaling["_u", name] = MOVE_SCALE[name]
            mpc.bounds["lower", "_u", name], mpc.bounds["upper", "_u", name] = limits.inputs[name]
        self.parameters = mpc.get_p_template(1)
        mpc.set_p_fun(lambda _now: self.parameters)
        mpc.prepare_nlp()
        for k in range(HORIZON):
            before = mpc.opt_p["_u_prev"] / mpc._u_scaling if k == 0 else mpc.opt_x["_u", k - 1, 0]
            move = mpc.opt_x["_u", k, 0] - before
            largest = np.array([limits.moves[name] / MOVE_SCALE[name] for name in MOVED])
            mpc.nlp_cons.append(move)
            mpc.nlp_cons_lb.append(-largest)
            mpc.nlp_cons_ub.append(largest)
        mpc.create_nlp()
        return mpc

    def __call__(self, time: float, state: FloatArray, parameters: FloatArray, held: FloatArray) -> FloatArray:
        """Solve from the state."""
        for i, value in enumerate(parameters):
            self.parameters["_p", 0, f"p{i}"] = value
        moved = self.cell.indices("inputs", MOVED)
        for i, q in enumerate(self.cell.inputs):
            if q.name not in MOVED:
                self.parameters["_p", 0, q.name] = held[i]
        if not self._started:
            self.mpc.x0, self.mpc.u0 = np.append(state, 0.0), held[moved]
            self.mpc.z0 = self.cell.ode(time, state, held, parameters)[3]
            self.mpc.set_initial_guess()
            self._started = True
        inputs = held.copy()
        inputs[moved] = np.array(self.mpc.make_step(np.append(state, 0.0).reshape(-1, 1))).ravel()
        assert self.mpc.solver_stats["success"], self.mpc.solver_stats["return_status"]
        return inputs
