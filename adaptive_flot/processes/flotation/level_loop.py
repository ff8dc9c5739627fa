"""The level loop of the cell: analysis and design with python-control.

The PI controller of the paper (Qtails) is part of the cell model: dQ_tails/dt = k_p dh_p/dt + (k_p / tau_i) e with
e = h_p - h_p_SP. The paper prints `- (k_p / tau_i) e`; with that sign the loop is unstable, which `loop_poles` shows.
"""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np

from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.linear import linearise, pi_gains


@dataclass(frozen=True)
class LevelLoop:
    """Stability of the level loop at an operating point.

    Attributes
    ----------
    gain_margin
        Factor by which the loop gain may rise before instability (infinite if never).
    phase_margin_deg
        Phase left at the crossover [degrees].
    crossover_rad_s
        Frequency where the open loop has gain 1 [rad/s].
    poles
        Poles of the whole cell with the loop closed [1/s] (nx,), complex.
    """

    gain_margin: float
    phase_margin_deg: float
    crossover_rad_s: float
    poles: FloatArray

    @property
    def stable(self) -> bool:
        """All poles in the open left half plane."""
        return bool(np.max(self.poles.real) < 0)


def pulp_response(model: Model, inputs: FloatArray) -> control.StateSpace:
    """Cell without its level loop, from tails flow [m3/s] to pulp height [m], at a steady state.

    Raises
    ------
    RangeError
        There is no steady state at these inputs.
    """
    cell = linearise(model, inputs)
    loop = model.index("states", "tails_flow")
    rest = [i for i in range(len(model.states)) if i != loop]
    level = [1.0 if model.states[i].name == "level" else 0.0 for i in rest]
    return control.ss(cell.A[np.ix_(rest, rest)], cell.A[rest, loop].reshape(-1, 1), [level], [[0.0]])


def analyse_level_loop(model: Model, inputs: FloatArray) -> LevelLoop:
    """Margins and poles of the level loop with the model's own gain and integral time.

    Parameters
    ----------
    model
        Flotation model.
    inputs
        Air flow, feed flow [m3/s] and level set-point [m] of the operating point (3,).

    Raises
    ------
    RangeError
        There is no steady state at these inputs.
    """
    values = dict(zip(model.names("parameters"), model.parameter_values, strict=True))
    open_loop = _open_loop(pulp_response(model, inputs), values["proportional_gain"], values["integral_time"])
    gain_margin, phase_margin, _, crossover = control.margin(open_loop)
    return LevelLoop(float(gain_margin), float(phase_margin), float(crossover), loop_poles(model, inputs))


def loop_poles(model: Model, inputs: FloatArray, *, printed_sign: bool = False) -> FloatArray:
    """Poles of the cell with its level loop [1/s] (nx,), complex; with the sign as the paper prints it on request."""
    a = np.array(linearise(model, inputs).A)
    if printed_sign:
        values = dict(zip(model.names("parameters"), model.parameter_values, strict=True))
        row, level = model.index("states", "tails_flow"), model.index("states", "level")
        a[row, level] -= 2 * values["proportional_gain"] / values["integral_time"]
    return np.linalg.eigvals(a)


def design_level_loop(
    model: Model, inputs: FloatArray, *, crossover_rad_s: float, phase_margin_deg: float = 60.0
) -> tuple[float, float]:
    """Gain [m2/s] and integral time [s] that give a crossover frequency and a phase margin at an operating point.

    The PI phase at the crossover, -atan(1 / (tau_i w)), makes up what the pulp leaves of the phase margin; the gain
    then sets the crossover.

    Raises
    ------
    RangeError
        The pulp alone has too little phase at this crossover; ask for a slower loop or a smaller margin.
    """
    response = -complex(pulp_response(model, inputs)(1j * crossover_rad_s))  # more tails flow lowers the level
    left = np.angle(response) + np.pi - np.deg2rad(phase_margin_deg)
    if not 0 < left < np.pi / 2:
        raise RangeError(
            f"level loop: a phase margin of {phase_margin_deg:g} degrees at {crossover_rad_s:g} rad/s asks the PI "
            f"controller for {np.rad2deg(-left):+.0f} degrees, it can give -90 to 0; change the crossover or the margin"
        )
    return pi_gains(response, float(left), crossover_rad_s)


def _open_loop(pulp: control.StateSpace, gain: float, integral_time: float) -> control.StateSpace:
    """Loop with the usual negative feedback: the pulp answers with the opposite sign, so it is taken in."""
    controller = control.ss([[0.0]], [[1.0]], [[gain / integral_time]], [[gain]])
    return control.series(controller, -pulp)
