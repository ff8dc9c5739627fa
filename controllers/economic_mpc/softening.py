"""Limits that no plan can keep are given up in a stated order, each by as little as can be.

The order, from the first given up to the last:

1. the largest move of an input, only where the input lies outside its range and has to come back;
2. the distance that is kept from a limit for what the model is off by;
3. the ranges of limited states, then the limits of outputs; option `priority` changes this part.

The range of an input is never given up. A plan that exceeds only what is given up first is in order, at that limit's
price. Else the problem is solved once for each limit that can not be kept: the excess of the first in `priority` is
minimised, then it is bounded by what was found, and the next one follows. The last solve is for value.

Each solve takes some Newton steps with an active-set method, for which bounds that leave hardly any room are no trouble
(fatrop may stall there). Where these do not come to the optimum, ipopt does. Source: Tyler & Morari, Automatica 35
(1999) 565; Kerrigan & Maciejowski, IEEE CACSD (2002), section 3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.problem.collocation import OptimalControlProblem
from controllers.economic_mpc.problem.layout import Bounds
from controllers.economic_mpc.problem.stage import Arguments
from controllers.economic_mpc.solvers.newton_step import PlanStep
from controllers.economic_mpc.solvers.nlp_solvers import interior_point
from controllers.economic_mpc.solvers.real_time_iteration import RealTimeIteration
from controllers.economic_mpc.solvers.verification import NlpSolution, Solver, Validity

TOLERANCES = 0.01, 0.1
"""An excess up to this counts as none, in units of a slack: that of an output limit, and that of a state's range. The
price on a state's slack is that of its square, so a plan always goes a little beyond a range that it would leave."""
SPARE = 0.5
"""Share of the tolerance by which an excess may be larger in the solves that follow."""
AHEAD = 100.0
"""Factor on the price of the limit whose turn it is."""
OPTIMUM = 1e-3
"""Largest change of a scaled variable by the last Newton step of a solve."""
INSIDE = 1e-3
"""How far inside its range an input may go that has to come back, as a share of the range."""


@dataclass(frozen=True)
class GivenUp:
    """A limit that a plan does not keep.

    Attributes
    ----------
    name
        Of the output, state or input.
    what
        In words: "lower limit of concentrate_grade".
    excess, unit
        Largest distance beyond it over the horizon, in that unit.
    """

    name: str
    what: str
    excess: float
    unit: str

    def __str__(self) -> str:
        return f"{self.what} by {self.excess:.3g}{'' if self.unit == '-' else ' ' + self.unit}"


class Softening:
    """Order in which limits are given up.

    Parameters
    ----------
    problem
        The problem.
    bounds
        Its ranges.
    priority
        Names of the limited outputs and states, the last given up first in the list. Default: outputs, then states.
    budget_s
        Wall-clock time of all solves of a decision [s], soft.

    Raises
    ------
    ModelError
        The priority does not name each limited output and state once.
    """

    def __init__(
        self, problem: OptimalControlProblem, bounds: Bounds, priority: Sequence[str] | None, budget_s: float
    ) -> None:
        self.layout, self.bounds, self.budget_s = problem.layout, bounds, budget_s
        layout = self.layout
        complete = interior_point(problem, "ipopt", budget_s)
        self.solver: Solver = RealTimeIteration(problem, PlanStep(problem), complete, until=OPTIMUM)
        ends = [(e.output, e.name, layout.model.outputs[e.index].unit) for e in layout.output_limits]
        states = [layout.model.states[layout.model.index("states", name)] for name in layout.states]
        self._limits = [*ends, *((q.name, f"range of {q.name}", q.unit) for q in states)]
        names = list(dict.fromkeys(name for name, _, _ in self._limits))
        if priority is not None and sorted(priority) != sorted(names):
            raise ModelError(
                f"economic_mpc: priority = {list(priority)}; give each limited output and state once: {names}"
            )
        # the last is given up first
        self.priority = tuple(names if priority is None else priority)
        of_outputs, of_states = TOLERANCES
        self._tolerance = np.array([of_outputs] * len(ends) + [of_states] * len(states))
        self._columns = {name: [i for i, at in enumerate(self._limits) if at[0] == name] for name in self.priority}
        self._true = np.array([e.value for e in layout.output_limits])
        self._scale = np.array([*layout.output_slack_scale, *layout.state_slack_scale])
        begin = layout.chosen.start + layout.inputs_size
        self._slacks = slice(begin, begin + layout.slacks_size)

    def way_back(
        self, plain: dict[str, FloatArray], held: FloatArray
    ) -> tuple[dict[str, FloatArray], tuple[GivenUp, ...]]:
        """Bounds in which inputs outside their range come back with the first move, whatever its size.

        Parameters
        ----------
        plain
            Bounds of the problem.
        held
            Moved inputs now (m,).
        """
        layout, (low, high) = self.layout, self.bounds.inputs.T
        back = np.clip(held, low, high) - held
        if not (np.abs(back) > self.bounds.moves).any():
            return plain, ()
        lines, inside = {key: plain[key].copy() for key in ("lbg", "ubg")}, INSIDE * (high - low)
        given_up = []
        for i in np.flatnonzero(np.abs(back) > self.bounds.moves):
            row, most = layout.rows["moves"][0][i], abs(back[i]) + inside[i]
            lines["lbg" if back[i] < 0 else "ubg"][row] = np.sign(back[i]) * most / layout.u_scale[i]
            quantity = layout.model.inputs[layout.moved[i]]
            excess = float(abs(back[i]) - self.bounds.moves[i])
            given_up.append(GivenUp(quantity.name, f"largest move of {quantity.name}", excess, quantity.unit))
        return plain | lines, tuple(given_up)

    def given_up(self, variables: FloatArray, limits: FloatArray) -> tuple[GivenUp, ...]:
        """Limits that a plan (n,) made with these values of the output limits does not keep, beyond the tolerance."""
        worst = self._excess(variables, limits).max(axis=0)
        beyond = np.flatnonzero(worst > self._tolerance)
        return tuple(
            GivenUp(name, what, float(worst[i] * self._scale[i]), unit)
            for i, (name, what, unit) in enumerate(self._limits)
            if i in beyond
        )

    def is_in_order(self, given_up: Sequence[GivenUp]) -> bool:
        """Whether a plan gives up nothing but what is the first to be given up."""
        return {each.name for each in given_up} <= set(self.priority[-1:] if len(self.priority) > 1 else ())

    def in_order(self, now: Arguments, bounds: dict[str, FloatArray], plain: NlpSolution) -> NlpSolution:
        """Plan that gives up limits in order; not valid where one of the solves fails or the time is up.

        Parameters
        ----------
        now, bounds
            What a plan is solved with.
        plain
            A plan that does not keep every limit.
        """
        seconds, best, excess = plain.seconds, plain, self._excess(plain.variables, now.limits)
        most = np.full_like(excess, np.inf)
        for name in self.priority:
            columns = self._columns[name]
            if (excess > self._tolerance)[:, columns].any():
                best = self.solver(
                    self._turn(now, name).vector(), self._capped(bounds, most), best.variables, best.multipliers
                )
                seconds += best.seconds
                if best.validity is not Validity.VALID or seconds > self.budget_s:
                    return replace(best, validity=_failed(best), seconds=seconds)
                excess = self._excess(best.variables, self._true)
            most[:, columns] = (excess + SPARE * self._tolerance)[:, columns]
        kept = np.zeros(len(self._scale))
        kept[: len(self._true)] = np.abs(now.limits - self._true)
        caps = self._capped(bounds, most + kept / self._scale)
        best = self.solver(now.vector(), caps, best.variables, best.multipliers)
        return replace(best, seconds=seconds + best.seconds)

    def _excess(self, variables: FloatArray, limits: FloatArray) -> FloatArray:
        """Distance beyond each limit in units of its slack (horizon, slacks), for a plan made with these limits."""
        slacks = np.abs(self.layout.stages(variables)[:, self._slacks])
        kept = np.zeros(slacks.shape[1])
        kept[: len(self._true)] = np.abs(limits - self._true)
        return np.asarray(np.maximum(slacks - kept / self._scale, 0.0))

    def _turn(self, now: Arguments, name: str) -> Arguments:
        """Arguments with which the excess of one limit is minimised: nothing is kept from the limits of outputs."""
        prices, first = now.prices.copy(), len(now.prices) - self.layout.slacks_size
        prices[[first + i for i in self._columns[name]]] *= AHEAD
        return replace(now, limits=self._true, prices=prices)

    def _capped(self, bounds: dict[str, FloatArray], most: FloatArray) -> dict[str, FloatArray]:
        """Bounds with slacks of at most so much (horizon, slacks)."""
        low, high = bounds["lbx"].copy(), bounds["ubx"].copy()
        self.layout.stages(high)[:, self._slacks] = most
        self.layout.stages(low)[:, self._slacks] = np.maximum(self.layout.stages(low)[:, self._slacks], -most)
        return bounds | {"lbx": low, "ubx": high}


def _failed(solution: NlpSolution) -> Validity:
    return Validity.VIOLATED if solution.validity is Validity.VALID else solution.validity


def in_words(given_up: Sequence[GivenUp]) -> str:
    """One clause for a message; empty where nothing was given up."""
    return "given up: " + ", ".join(map(str, given_up)) if given_up else ""


def by_name(given_up: Sequence[GivenUp]) -> Mapping[str, float]:
    """Largest excess of each quantity, in its unit."""
    found: dict[str, float] = {}
    for each in given_up:
        found[each.name] = max(each.excess, found.get(each.name, 0.0))
    return found
