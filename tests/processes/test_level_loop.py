"""The level loop: the printed sign is unstable, ours is not; the margins are those of the loop that is simulated."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.errors import RangeError
from adaptive_flot.greybox import Model, Stepper, steady_state
from adaptive_flot.processes.flotation.level_loop import (
    analyse_level_loop,
    design_level_loop,
    loop_poles,
    pulp_response,
)

POINTS = [np.array([air, 1.67e-4, level]) for air in (9.05e-4, 2.17e-3) for level in (0.34, 0.41)]


@pytest.mark.parametrize("inputs", POINTS, ids=str)
def test_our_sign_is_stable_and_the_printed_one_is_not(model: Model, inputs: np.ndarray) -> None:
    loop = analyse_level_loop(model, inputs)
    assert loop.stable and np.max(loop.poles.real) < 0
    assert np.max(loop_poles(model, inputs, printed_sign=True).real) > 0


@pytest.mark.parametrize("inputs", POINTS, ids=str)
def test_poles_are_the_roots_of_one_plus_the_open_loop(model: Model, inputs: np.ndarray) -> None:
    """Two ways to the closed loop: eigenvalues of the whole cell, and 1 - PI(s) G(s) = 0 with the loop cut open."""
    gain, integral_time = (
        model.parameters[model.index("parameters", name)].value for name in ("proportional_gain", "integral_time")
    )
    pulp = pulp_response(model, inputs)
    own = pulp.poles()
    moved = [s for s in loop_poles(model, inputs) if np.min(np.abs(own - s) / np.abs(s)) > 1e-3]
    assert len(moved) >= 2  # level and integrator; the mineral masses do not act on the level
    for s in moved:
        assert 1 - gain * (1 + 1 / (integral_time * s)) * complex(pulp(s)) == pytest.approx(0, abs=1e-5)


def test_design_gives_back_crossover_and_phase_margin(model: Model) -> None:
    inputs = np.array([1.5e-3, 1.67e-4, 0.38])
    gain, integral_time = design_level_loop(model, inputs, crossover_rad_s=0.03, phase_margin_deg=55)
    loop = analyse_level_loop(
        model.with_parameters({"proportional_gain": gain, "integral_time": integral_time}), inputs
    )
    assert loop.crossover_rad_s == pytest.approx(0.03, rel=1e-6)
    assert loop.phase_margin_deg == pytest.approx(55, abs=1e-4)


def test_a_margin_that_no_pi_controller_gives_is_refused(model: Model) -> None:
    with pytest.raises(RangeError, match="change the crossover or the margin"):
        design_level_loop(model, np.array([1.5e-3, 1.67e-4, 0.38]), crossover_rad_s=0.02, phase_margin_deg=120)


def test_the_simulated_level_settles_at_its_set_point(model: Model) -> None:
    """The loop that was analysed is the loop that is simulated: a step of 3 cm is gone after ten minutes."""
    start = np.array([1.5e-3, 1.67e-4, 0.36])
    moved = np.array([1.5e-3, 1.67e-4, 0.39])
    run = Stepper(model, 1.0).simulate(steady_state(model, start).state, np.tile(moved, (900, 1)))
    level = run.states[:, model.index("states", "level")]
    assert abs(level[-1] - 0.39) < 1e-3
    assert np.max(level) < 0.39 + 0.02
