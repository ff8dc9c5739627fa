"""Protects the search on an oscillator whose spring hardens, from a linear model and a record that grows in amplitude.

The record comes from equations of its own, integrated here by Runge and Kutta. A spline that is straight at its ends
left an error there, and a sensor that "shows 132 % too much" was named beside it: gain and sensor are one number.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.record.moved_inputs import MOVED
from adaptive_flot.discovery.verdict.words.curve import effect_curves
from adaptive_flot.discovery.verdict.words.sizes import words_of_effects
from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope

DT, ROWS, STEPS, NOISE = 1.0 / 600, 900, 8, 2e-4
GAIN, STIFFNESS, DAMPING = 1.6e5, 1.8e5, 35.0


def oscillator() -> Model:
    """A mass between a linear spring and a linear damper."""

    def equations(m: Scope) -> None:
        position, speed = m.state("position"), m.state("speed")
        drive = m.site("drive", m.parameter("gain") * m.input("voltage"), "actuator", "offset")
        spring = m.site("spring", m.parameter("stiffness") * position, "process", "offset")
        damper = m.site("damper", m.parameter("damping") * speed, "process", "offset")
        m.derivative("position", speed)
        m.derivative("speed", drive - spring - damper)
        m.output("measured", m.site("sensor", position, "sensor", "offset"))

    return Model(
        name="oscillator",
        states=(Quantity("position", "m", "", -5.0, 5.0, 0.1), Quantity("speed", "m/s", "", -5e3, 5e3, 40.0)),
        inputs=(Quantity("voltage", "V", "", -5.0, 5.0, 0.1),),
        parameters=(
            Parameter("gain", 1.5e5, "m/s2/V", "guess", "b", 1e4, 1e6, 1e4, role="estimated"),
            Parameter("stiffness", 1.7e5, "1/s2", "guess", "k", 1e4, 1e6, 1e4, role="estimated"),
            Parameter("damping", 40.0, "1/s", "guess", "d", 1.0, 400.0, 10.0, role="estimated"),
        ),
        outputs=(Quantity("measured", "m", "", -5.0, 5.0, 0.1),),
        equations=equations,
        max_step_s=DT / 4,
        starts_steady=False,
        initial_guess={"position": 0.0, "speed": 0.0},
    )


def record(cubic: float, rows: int = ROWS) -> Dataset:
    """A record with a force of the third power of the position, over the mass [1/(m2 s2)]."""
    rng = np.random.default_rng(1)
    frequency = np.fft.rfftfreq(rows, DT)
    phases = np.exp(2j * np.pi * rng.random(len(frequency)))
    voltage = np.fft.irfft(np.where((frequency > 1) & (frequency < 150), phases, 0), rows)
    voltage *= 0.045 / voltage.std() * np.linspace(0.3, 1.6, rows)
    z, h, seen = np.zeros(2), DT / STEPS, np.zeros(rows)

    def rate(z: np.ndarray, u: float) -> np.ndarray:
        return np.array([z[1], GAIN * u - STIFFNESS * z[0] - DAMPING * z[1] - cubic * z[0] ** 3])

    for k in range(1, rows):
        for _ in range(STEPS):
            a = rate(z, voltage[k])
            b = rate(z + h / 2 * a, voltage[k])
            c = rate(z + h / 2 * b, voltage[k])
            z = z + h / 6 * (a + 2 * b + 2 * c + rate(z + h * c, voltage[k]))
        seen[k] = z[0]
    seen += NOISE * rng.standard_normal(rows)
    return Dataset("oscillator", DT * np.arange(rows, dtype=float), DT, voltage[:, None], seen[:, None])


def test_inputs_that_act_a_row_later_than_the_record_says_are_no_effect() -> None:
    """A logger writes an input with what was measured when it was given. A drive that "answers late" was told."""
    there = record(0.0, 200)
    logged = replace(there, inputs=np.vstack([there.inputs[1:], there.inputs[-1:]]))
    verdict = discover(oscillator(), logged).verdict
    assert verdict.word == "none", verdict.reason
    assert MOVED in verdict.notes and MOVED in verdict.reason


@pytest.mark.parametrize("cubic", [7e5, 0.0])
def test_a_hardening_spring_is_a_force_over_the_position_and_nothing_else(cubic: float) -> None:
    """Spring and damper are forces of one balance: over the position, they are the same term by two names."""
    found = discover(oscillator(), record(cubic))
    verdict = found.verdict
    if not cubic:
        assert verdict.word == "none", verdict.reason
        return
    assert verdict.word in ("named", "class"), verdict.reason
    told = set(verdict.members) | {(e.effect.site, e.effect.driver) for e in verdict.effects}
    assert ("spring", "position") in told
    assert told <= {("spring", "position"), ("damper", "position"), ("drive", "position")}
    assert verdict.error[0].after < 1.25 * NOISE
    # the straight part of the law is the fitted stiffness: the picture shows the bend alone, and its band holds it
    assert found.problem is not None and found.told is not None
    (curve,) = effect_curves(found.problem, found.told, 1)
    assert curve.bend_only and curve.anchor is not None
    sign = -1 if curve.effect.site == "drive" else 1
    truth = sign * cubic * (curve.driver**3 - curve.anchor**3 - 3 * curve.anchor**2 * (curve.driver - curve.anchor))
    np.testing.assert_allclose(curve.change, truth, atol=0.02 * np.max(np.abs(truth)))
    assert np.all(np.abs(curve.change - truth) < np.maximum(2 * (curve.high - curve.change), 1e-3 * np.max(truth)))
    assert "than a straight line through the middle says" in words_of_effects(
        found.told.model, verdict.effects, [curve]
    )
