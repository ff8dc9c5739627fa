"""What acts back in the cell: the level loop on what its sensor says, and effects of the concentrate grade."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.processes.flotation import make_model

INPUTS = np.array([1.5e-3, 1.67e-4, 0.38])
REFERENCE = 1.5e-3
AIR = Effect("level_sensor", "air_flow", "linear", {"slope": 0.02}, {"reference": REFERENCE})
GRADE = Effect("floatability_valuable", "grade", "linear", {"slope": -0.4}, {"reference": 0.25})


@pytest.fixture(scope="module")
def model() -> Model:
    return make_model()


def output(model: Model, x: FloatArray, u: FloatArray, name: str) -> float:
    return float(FastCall(model.ode)(0.0, x, u, model.parameter_values)[1][model.index("outputs", name)])


@given(air=st.floats(1.0e-3, 2.1e-3))
def test_the_loop_passes_a_jump_of_its_sensor_on_at_once(air: float) -> None:
    """A PI controller is written on the measured level: its proportional part jumps with it, by gain times jump."""
    model = make_model().with_effects([AIR])
    x = steady_state(model, INPUTS).state
    jump = 0.02 * (air / REFERENCE - 1)
    gain = model.parameter_values[model.index("parameters", "proportional_gain")]
    before, after = (output(model, x, u, "tails_flow") for u in (INPUTS, np.array([air, *INPUTS[1:]])))
    assert after - before == pytest.approx(gain * jump, abs=1e-12)


def test_the_loop_is_the_pi_controller_of_the_measured_level() -> None:
    """Against the position form of the controller, summed up from the outputs of the run itself."""
    model = make_model().with_effects([AIR])
    inputs = np.repeat([[1.5e-3, 1.67e-4, 0.38], [1.9e-3, 1.67e-4, 0.38], [1.3e-3, 1.7e-4, 0.39]], 480, axis=0)
    run = Stepper(model, 0.25).simulate(steady_state(model, inputs[0]).state, inputs, model.parameter_values)
    level, tails = (run.outputs[:, model.index("outputs", n)] for n in ("level", "tails_flow"))
    p = dict(zip(model.names("parameters"), model.parameter_values, strict=True))
    kp, ti = p["proportional_gain"], p["integral_time"]
    error = level - inputs[:, 2]
    for block in (slice(0, 480), slice(480, 960), slice(960, 1440)):  # the integral is smooth inside a block
        e, q, h = error[block], tails[block], level[block]
        integral = np.concatenate([[0.0], 0.25 * np.cumsum((e[1:] + e[:-1]) / 2)])
        np.testing.assert_allclose(q - q[0], kp * (h - h[0]) + kp / ti * integral, atol=5e-10)
    steady = run.outputs[479, model.index("outputs", "level")]
    assert steady == pytest.approx(0.38, abs=1e-6)  # the loop holds what it sees, not what is


def test_an_effect_of_the_grade_is_nothing_at_amplitude_zero(model: Model) -> None:
    none = Effect("floatability_valuable", "grade", "linear", {}, {"reference": 0.25})
    extended = model.with_effects([none])
    assert extended.names("states")[:-1] == model.names("states")
    assert extended.without_effects().names("states") == model.names("states")
    inputs = np.repeat([[1.5e-3, 1.67e-4, 0.38], [1.9e-3, 1.67e-4, 0.36]], 60, axis=0)
    x = steady_state(model, inputs[0]).state
    plain, with_it = (
        Stepper(m, 1.0).simulate(start, inputs, m.parameter_values)
        for m, start in ((model, x), (extended, np.append(x, 0.2)))
    )
    np.testing.assert_array_equal(with_it.outputs, plain.outputs)


def test_at_rest_the_grade_acts_on_itself(model: Model) -> None:
    """The fixed point of floatability and grade, found by hand from the plain model at several floatabilities."""
    extended = model.with_effects([GRADE])
    whole = steady_state(extended, INPUTS)
    grade = output(extended, whole.state, INPUTS, "concentrate_grade")
    assert whole.state[-1] == pytest.approx(grade, rel=1e-9)
    name = next(n for n in model.names("parameters") if n.startswith("floatability."))
    value = model.parameter_values[model.index("parameters", name)]
    changed = model.with_parameters({name: value * np.exp(-0.4 * (grade / 0.25 - 1))})
    alone = steady_state(changed, INPUTS)
    assert output(changed, alone.state, INPUTS, "concentrate_grade") == pytest.approx(grade, rel=1e-7)


def test_a_sensor_sees_the_grade_without_delay(model: Model) -> None:
    """A calibration error is a function of the grade itself, not of one that follows it."""
    bent = Effect("grade_sensor", "grade", "linear", {"slope": 0.05}, {"reference": 0.25})
    extended = model.with_effects([bent])
    x = steady_state(model, INPUTS).state
    grade = output(model, x, INPUTS, "concentrate_grade")
    for follower in (0.1, 0.4):
        told = output(extended, np.append(x, follower), INPUTS, "concentrate_grade")
        assert told == pytest.approx(grade + 0.05 * (grade / 0.25 - 1), abs=1e-12)
