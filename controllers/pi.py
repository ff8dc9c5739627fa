"""PI control of one limited output by one input: the baseline that an economic MPC has to beat.

Designed with python-control on the model linearised at the last planned inputs: the gain gives the crossover asked for,
the integral time the phase margin. Measured disturbances are fed forward, as an economic MPC is told of them too. The
other inputs stay where they are planned. In a flotation cell the air flow holds the concentrate grade.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import control
import numpy as np

from adaptive_flot.contracts import ControllerSetup, Decision, Estimate, Sample, Status
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.linear import linearise, pi_gains
from controllers.feed_forward import FeedForward, has_disturbances

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
        Filtered error of the output, NaN before the first.
    inputs
        Inputs held now (nu,).
    feed, fed_forward
        State of the feed-forward, and what it asked of the input last, NaN before the first.
    """

    row: int
    error: float
    inputs: FloatArray | None
    feed: FloatArray
    fed_forward: float = float("nan")


class Pi:
    """Holds a measured output inside its limit, a margin away from it, by moving one input.

    The output is the first limited one, its limit the lower end of its range, or the upper where it has no lower. The
    input is the first of the model's inputs that may be moved.

    Parameters
    ----------
    setup
        Model, schedule and limits.
    margin
        Distance of the set-point to the limit, in the output's unit: what noise and disturbances need.
    crossover_rad_s, phase_margin_deg
        What the design asks of the loop; where the process leaves more phase than a PI controller can use up, the
        margin is larger.
    filter_s
        Time constant of the first-order filter on the measured output [s].
    feed_forward
        Whether the input also answers measured disturbances, before the output shows them (`FeedForward`).

    Raises
    ------
    ModelError
        The setup has no limits of an output and an input, or an option is not positive.
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
            raise ModelError("pi needs limits; give them (in a scenario: the key 'limits')")
        if not setup.limits.inputs or not setup.limits.outputs:
            raise ModelError("pi holds an output by an input; give 'limits' a range of one output and of one input")
        if not (crossover_rad_s > 0 and filter_s > 0 and 0 < phase_margin_deg < 180):
            raise ModelError("pi: crossover_rad_s and filter_s must be positive, phase_margin_deg between 0 and 180")
        self.setup = setup
        model = setup.model
        output, (lower, upper) = next(iter(setup.limits.outputs.items()))
        self.setpoint = lower + margin if np.isfinite(lower) else upper - margin
        self._output = model.index("outputs", output)
        self._input = min(model.indices("inputs", setup.limits.inputs))
        moved = model.inputs[self._input].name
        self._range = setup.limits.inputs[moved]
        self.gain, self.integral_time = design(
            model, (moved, output), setup.schedule[-1], filter_s, crossover_rad_s, np.deg2rad(phase_margin_deg)
        )
        self._memory = float(np.exp(-setup.dt / filter_s))
        ahead = FeedForward(setup, (moved, output)) if feed_forward and has_disturbances(setup) else None
        self.feed_forward = ahead

    def init(self, time: float) -> PiState:
        """Start before the first sample."""
        del time
        return PiState(0, float("nan"), None, np.empty(0) if self.feed_forward is None else self.feed_forward.start())

    def tracked(self, state: PiState, inputs: FloatArray) -> PiState:
        """Go on from what really acts; see `TracksInputs.tracked`. In velocity form that is bumpless."""
        return replace(state, inputs=inputs.copy())

    def decide(self, state: PiState, sample: Sample | None, estimate: Estimate | None) -> tuple[PiState, Decision]:
        """Planned inputs until the estimator runs (as every controller here), then the PI law in velocity form."""
        planned = self.setup.schedule[min(state.row, len(self.setup.schedule) - 1)]
        after = replace(state, row=state.row + 1)
        if sample is None or estimate is None or state.inputs is None:
            return replace(after, inputs=planned.copy()), Decision(planned.copy(), Status.OK, "schedule")
        after, ahead = self._feed_change(after, sample)
        measured = float(sample.outputs[self._output])
        is_measured = np.isfinite(measured)
        error, change = state.error, 0.0
        if is_measured:
            error = measured - self.setpoint
            if np.isfinite(state.error):
                error = self._memory * state.error + (1 - self._memory) * error
                change = error - state.error
        back = self.gain * (change + self.setup.dt / self.integral_time * error) if is_measured else 0.0
        inputs = state.inputs.copy() if not is_measured else planned.copy()
        # in velocity form a limit does not wind up the integral
        inputs[self._input] = float(np.clip(state.inputs[self._input] + back + ahead, *self._range))
        status = Status.OK if is_measured else Status.MISSING
        return replace(after, error=error, inputs=inputs), Decision(inputs.copy(), status, "pi")

    def _feed_change(self, state: PiState, sample: Sample) -> tuple[PiState, float]:
        """How much more of the input than an interval ago the measured disturbances ask for, in its unit."""
        if self.feed_forward is None:
            return state, 0.0
        feed, asked = self.feed_forward.step(state.feed, sample)
        change = asked - state.fed_forward if np.isfinite(state.fed_forward) else 0.0
        return replace(state, feed=feed, fed_forward=asked), change


def design(
    model: Model,
    pair: tuple[str, str],
    inputs: FloatArray,
    filter_s: float,
    crossover_rad_s: float,
    phase_margin_rad: float,
) -> tuple[float, float]:
    """Gain [unit of the input per unit of the output] and integral time [s] at an operating point.

    The gain is that on measured minus set-point: positive where more of the input lowers the output.

    Parameters
    ----------
    model
        The process.
    pair
        Names of the input that is moved and of the output that it holds.
    inputs
        Operating point (nu,).
    filter_s
        Time constant of the filter on the measured output [s].
    crossover_rad_s, phase_margin_rad
        What is asked of the loop [rad/s], [rad].

    Raises
    ------
    RangeError
        There is no steady state at these inputs.
    """
    moved, output = pair
    response_of_output = linearise(model, inputs)[output, moved]
    loop = control.series(response_of_output, control.tf([1.0], [filter_s, 1.0]))
    lowers = float(np.real(control.dcgain(response_of_output))) < 0
    response = complex(loop(1j * crossover_rad_s))
    response = -response if lowers else response
    left = float(np.angle(response)) + np.pi - phase_margin_rad
    lag = float(np.clip(left, np.deg2rad(1.0), np.deg2rad(MOST_LAG_DEG)))
    gain, integral_time = pi_gains(response, lag, crossover_rad_s)
    return gain if lowers else -gain, integral_time
