"""Probing: short dips of the air flow that tell n from C, made only while they are needed and paid for.

At its constraints an economic MPC moves so little that its own estimator starves: n and C act on the grade through the
froth bubble size alone, so a lasting operating point shows one combination of them. Another air flow changes how long
the froth stays, and with it the combination that the grade shows. A dip lasts one control move: an estimator that
forgets within a minute has to see both sides of it before it forgets. Less air raises the grade, so a dip never goes
towards the grade limit, and what it costs is known beforehand: the difference in value between the plan with and
without it. A wage of `most_cu_h` is earned every hour; a dip is made when its predicted price has been earned and the
estimate is uncertain. So the predicted price of probing is bounded, whatever the estimator says.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.contracts import Estimate, Limits
from adaptive_flot.economics import Prices
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.collocation import Problem
from controllers.economic_mpc.layout import MOVED, Layout

AIR = MOVED.index("air_flow")
HOUR = 3600.0
WITHIN = 0.999
"""Share of the largest move that a dip asks for at most: the solver is never at the edge of what it may do."""


@dataclass(frozen=True)
class ProbeState:
    """What the next decision needs.

    Attributes
    ----------
    start
        Since when the wage is earned [s].
    spent
        Predicted price of the dips so far [cu].
    asked
        Predicted price of the last dip that was considered [cu].
    until
        End of the last dip [s].
    """

    start: float
    spent: float = 0.0
    asked: float = 0.0
    until: float = -np.inf


class Probing:
    """When to probe, and what the optimiser is asked for then.

    Parameters
    ----------
    limits
        Range and largest move of the air flow.
    move_s
        Length of a control move [s].
    most_cu_h
        Predicted price of probing, at most [cu/h].
    needed_std
        Relative standard deviation of an adapted parameter from which probing is worth its price.
    amplitude_m3_s
        Depth of a dip of the air flow [m3/s]; default the largest move.

    Raises
    ------
    ModelError
        An option outside its range.
    """

    def __init__(
        self,
        limits: Limits,
        move_s: float,
        *,
        most_cu_h: float = 0.05,
        needed_std: float = 0.02,
        amplitude_m3_s: float | None = None,
    ) -> None:
        largest = limits.moves["air_flow"]
        amplitude = largest if amplitude_m3_s is None else amplitude_m3_s
        if not (most_cu_h > 0 and needed_std >= 0):
            raise ModelError("probing: most_cu_h must be positive and needed_std at least 0")
        if not 0 < amplitude <= largest:
            raise ModelError(
                f"probing: amplitude_m3_s = {amplitude:g} is not a move that is allowed; give at most {largest:g}, the "
                "largest move of the air flow"
            )
        self.lowest = limits.inputs["air_flow"][0]
        self.amplitude = WITHIN * amplitude
        self.move_s = move_s
        self.most_cu_h = most_cu_h
        self.needed_std = needed_std

    def is_due(self, state: ProbeState, estimate: Estimate, air: float) -> bool:
        """Whether the estimate is uncertain, there is room below the air flow, and the price last asked is earned.

        Dips alternate with moves that are free: two in a row would be a step, and a step is soon forgotten.
        """
        if estimate.time < state.until + self.move_s - 1e-9 or air - self.amplitude < self.lowest:
            return False
        std = np.sqrt(np.diag(estimate.covariance)) / np.abs(estimate.parameters)
        uncertain = bool(np.max(std, initial=0.0) >= self.needed_std)
        earned = self.earned(state, estimate.time)
        return uncertain and earned > 0 and earned - state.spent >= state.asked

    def earned(self, state: ProbeState, time: float) -> float:
        """What may have been spent by a time [cu]."""
        return self.most_cu_h * (time - state.start) / HOUR

    def pay(self, state: ProbeState, price: float, time: float) -> tuple[ProbeState, bool]:
        """Make a dip for a price [cu] if it has been earned, and keep the price in mind if not."""
        asked = replace(state, asked=max(price, 0.0))
        if not state.spent + price <= self.earned(state, time):
            return asked, False
        return replace(asked, spent=state.spent + asked.asked, until=time + self.move_s), True

    def bounds(self, air: float, layout: Layout, plain: dict[str, FloatArray]) -> dict[str, FloatArray]:
        """Bounds of the optimisation with a dip in its first move.

        Parameters
        ----------
        air
            Air flow now [m3/s].
        layout, plain
            Of the optimisation, and its bounds without probing.
        """
        upper = plain["ubx"].copy()
        upper[layout.chosen.start + AIR] = (air - self.amplitude) / layout.u_scale[AIR]
        return plain | {"ubx": upper}


def price(problem: Problem, free: FloatArray, asked: FloatArray, arguments: FloatArray) -> float:
    """What one solution (n,) earns less than another by the prices: neither moves nor slacks are in the account."""
    terms = len(Prices().values())
    worth, less = (np.array(problem.terms(solution, arguments)).ravel()[:terms].sum() for solution in (free, asked))
    return float(worth - less)
