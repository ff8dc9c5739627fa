"""Probing: short dips of one input that tell parameters apart, made only while they are needed and paid for.

At its constraints an economic MPC moves so little that its own estimator starves. In a flotation cell n and C act on
the grade through the froth bubble size alone, so a lasting operating point shows one combination of them. Another air
flow changes how long the froth stays, and with it the combination that the grade shows. Less air raises the grade, so a
dip of the air flow never goes towards the grade limit.

A dip lasts one control move: an estimator that forgets within a minute has to see both sides of it before it forgets.
What it costs is known beforehand: the difference in value between the plan with and without it. A budget of
`most_cu_h` grows every hour. A dip is made when the budget covers its predicted price and the estimate is uncertain.
So the predicted price of probing is bounded, whatever the estimator says.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.contracts import Estimate, Limits
from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.problem.collocation import OptimalControlProblem
from controllers.economic_mpc.problem.layout import StageLayout
from controllers.economic_mpc.state import ProbeState

HOUR = 3600.0
WITHIN = 0.999
"""Share of the largest move that a dip asks for at most: the solver is never at the edge of what it may do."""


class Probing:
    """When to probe, and what the optimiser is asked for then.

    Parameters
    ----------
    layout, limits
        Of the optimisation.
    most_cu_h
        Predicted price of probing, at most [cu/h].
    needed_std
        Relative standard deviation of an adapted parameter from which probing is worth its price.
    dipped
        Name of the input that dips; default the first that the controller moves.
    amplitude
        Depth of a dip in the unit of that input; default its largest move.

    Raises
    ------
    ModelError
        An option outside its range.
    """

    def __init__(
        self,
        layout: StageLayout,
        limits: Limits,
        *,
        most_cu_h: float = 0.05,
        needed_std: float = 0.02,
        dipped: str | None = None,
        amplitude: float | None = None,
    ) -> None:
        dipped = layout.moved_names[0] if dipped is None else dipped
        if dipped not in layout.moved_names:
            known = near_match(dipped, layout.moved_names)
            raise ModelError(f"probing: {dipped!r} is no input that the controller moves; {known}")
        largest = limits.moves[dipped]
        amplitude = largest if amplitude is None else amplitude
        if not (most_cu_h > 0 and needed_std >= 0):
            raise ModelError("probing: most_cu_h must be positive and needed_std at least 0")
        if not 0 < amplitude <= largest:
            raise ModelError(
                f"probing: amplitude = {amplitude:g} is not a move that is allowed; give at most {largest:g}, the "
                f"largest move of {dipped}"
            )
        self.position = layout.moved_names.index(dipped)
        self.lowest = limits.inputs[dipped][0]
        self.amplitude = WITHIN * amplitude
        self.layout = layout
        self.most_cu_h = most_cu_h
        self.needed_std = needed_std

    def is_due(self, state: ProbeState, estimate: Estimate, held: float) -> bool:
        """Whether the estimate is uncertain, there is room for a dip, and the budget covers the price last asked.

        Dips alternate with moves that are free: two in a row would be a step, and a step is soon forgotten.
        """
        if estimate.time < state.until + self.layout.move_s - 1e-9 or held - self.amplitude < self.lowest:
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
        return replace(asked, spent=state.spent + asked.asked, until=time + self.layout.move_s), True

    def bounds(self, held: float, plain: dict[str, FloatArray]) -> dict[str, FloatArray]:
        """Bounds of the optimisation with a dip in its first move.

        Parameters
        ----------
        held
            Value of the input now, in its unit.
        plain
            Bounds without probing.
        """
        upper = plain["ubx"].copy()
        upper[self.layout.chosen.start + self.position] = (held - self.amplitude) / self.layout.u_scale[self.position]
        return plain | {"ubx": upper}


def price(problem: OptimalControlProblem, free: FloatArray, asked: FloatArray, arguments: FloatArray) -> float:
    """What one solution (n,) earns less than another by the prices: neither moves nor slacks are in the account."""
    terms = problem.stage.economic_terms
    worth, less = (np.array(problem.terms(solution, arguments)).ravel()[:terms].sum() for solution in (free, asked))
    return float(worth - less)
