"""PI control of the concentrate grade by the air flow: the baseline that an economic MPC has to beat.

Designed with python-control on the cell linearised at the last planned inputs: the gain gives the crossover asked for,
the integral time the phase margin. What is measured of the feed is fed forward, as an economic MPC is told of it too.
The level set-point stays where it is planned.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import control
import numpy as np

from adaptive_flot.contracts import ControllerSetup, Decision, Estimate, Sample, Status
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.linear import linearise, pi_gains
from adaptive_flot.greybox.model import FloatArray, Model
from controllers.economic_mpc.feed_forward import FeedForward

MOST_LAG_DEG = 80.0
"""Phase lag a PI controller gives at most in this design; with 90 degrees it would be a mere integrator."""


@dataclass(frozen=True)
class PiState:
    """What the next decision needs.

    Attributes
    ----------
    row
        Row of the schedule to come.
    error
        Filtered grade error, NaN before the first.
    inputs
        Inputs held now (nu,).
    feed, fed_forward
        State of the feed-forward, and the air flow it asked for last [m3/s], NaN before the first.
    """

    row: int
    error: float
    inputs: FloatArray | None
    feed: FloatArray
    fed_forward: float = float("nan")


class Pi:
    """Holds the measured grade at the limit plus a margin by moving the air flow.

    Parameters
    ----------
    setup
        Model, schedule and limits.
    margin
        Set-point above the grade limit [-]: what noise and disturbances need.
    crossover_rad_s, phase_margin_deg
        What the design asks of the loop; where the cell leaves more phase than a PI controller can use up, the margin
        is larger.
    filter_s
        Time constant of the first-order filter on the measured grade [s].
    feed_forward
        Whether the air also answers what is measured of the feed, before the grade shows it (`FeedForward`).

    Raises
    ------
    ModelError
        The setup has no limits, or an option is not positive.
    RangeError
        There is no steady state at the planned inputs.
    """

    def __init__(
        self,
        setup: ControllerSetup,
        *,
        margin: float = 0.004,
        crossover_rad_s: float = 0.01,
        phase_margin_deg: float = 60.0,
        filter_s: float = 10.0,
        feed_forward: bool = True,
    ) -> None:
        if setup.limits is None:
            raise ModelError("pi needs limits; add 'limits' to the scenario")
        if "air_flow" not in setup.limits.inputs:
            raise ModelError("pi moves 'air_flow'; give its range in 'limits'")
        if not (crossover_rad_s > 0 and filter_s > 0 and 0 < phase_margin_deg < 180):
            raise ModelError("pi: crossover_rad_s and filter_s must be positive, phase_margin_deg between 0 and 180")
        self.setup = setup
        self.setpoint = setup.limits.grade + margin
        self._air = setup.model.index("inputs", "air_flow")
        self._grade = setup.model.index("outputs", "concentrate_grade")
        self.gain, self.integral_time = design(
            setup.model, setup.schedule[-1], filter_s, crossover_rad_s, np.deg2rad(phase_margin_deg)
        )
        self._memory = float(np.exp(-setup.dt / filter_s))
        self.feed_forward = FeedForward(setup.model, setup.schedule[-1], setup.dt) if feed_forward else None

    def init(self, time: float) -> PiState:
        """Start before the first sample."""
        del time
        return PiState(0, float("nan"), None, np.empty(0) if self.feed_forward is None else self.feed_forward.start())

    def decide(self, state: PiState, sample: Sample | None, estimate: Estimate | None) -> tuple[PiState, Decision]:
        """Planned inputs until the estimator runs (as every controller here), then the PI law in velocity form."""
        planned = self.setup.schedule[min(state.row, len(self.setup.schedule) - 1)]
        after = replace(state, row=state.row + 1)
        if sample is None or estimate is None or state.inputs is None:
            return replace(after, inputs=planned.copy()), Decision(planned.copy(), Status.OK, "schedule")
        after, ahead = self._feed_change(after, sample)
        measured = float(sample.outputs[self._grade])
        found = np.isfinite(measured)
        error, change = state.error, 0.0
        if found:
            error = measured - self.setpoint
            if np.isfinite(state.error):
                error = self._memory * state.error + (1 - self._memory) * error
                change = error - state.error
        back = self.gain * (change + self.setup.dt / self.integral_time * error) if found else 0.0
        inputs = state.inputs.copy() if not found else planned.copy()
        inputs[self._air] = self._limited(state.inputs[self._air] + back + ahead)
        status = Status.OK if found else Status.MISSING
        return replace(after, error=error, inputs=inputs), Decision(inputs.copy(), status, "pi")

    def _feed_change(self, state: PiState, sample: Sample) -> tuple[PiState, float]:
        """How much more air than an interval ago the feed asks for [m3/s]."""
        if self.feed_forward is None:
            return state, 0.0
        feed, asked = self.feed_forward.step(state.feed, sample)
        change = asked - state.fed_forward if np.isfinite(state.fed_forward) else 0.0
        return replace(state, feed=feed, fed_forward=asked), change

    def _limited(self, air: float) -> float:
        """Within the air limits: in velocity form a limit does not wind up the integral."""
        assert self.setup.limits is not None  # checked by the constructor
        low, high = self.setup.limits.inputs["air_flow"]
        return float(np.clip(air, low, high))


def design(
    model: Model, inputs: FloatArray, filter_s: float, crossover_rad_s: float, phase_margin_rad: float
) -> tuple[float, float]:
    """Gain [m3/s per unit of grade] and integral time [s] of the grade loop at an operating point."""
    cell = linearise(model, inputs)
    loop = control.series(cell["concentrate_grade", "air_flow"], control.tf([1.0], [filter_s, 1.0]))
    response = -complex(loop(1j * crossover_rad_s))  # more air lowers the grade
    left = float(np.angle(response)) + np.pi - phase_margin_rad
    lag = float(np.clip(left, np.deg2rad(1.0), np.deg2rad(MOST_LAG_DEG)))
    return pi_gains(response, lag, crossover_rad_s)
