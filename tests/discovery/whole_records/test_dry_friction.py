"""Protects the search on a process that moves both ways: a positioning drive with dry friction, which its model lacks.

The record comes from equations of its own, integrated here by the midpoint rule. It goes along a planned course under a
controller, as such drives do.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.since_reference import searched_change
from adaptive_flot.discovery.since_reference.changes import find_changes
from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope

DT, ROWS, STEPS = 0.005, 2500, 20
GAIN, MASS, VISCOUS = 35.0, 95.0, 200.0
"""Of motor [N/V], carriage [kg] and bearing [N s/m]."""
NOISE = 2e-5
"""Standard deviation of the encoder [m]."""


def drive() -> Model:
    """A carriage with viscous friction only."""

    def equations(m: Scope) -> None:
        position, speed = m.state("position"), m.state("speed")
        force = m.site("motor_force", GAIN * m.input("voltage"), "actuator", "offset", unit="N")
        friction = m.site("friction", m.parameter("viscous") * speed, "process", "offset", unit="N")
        m.derivative("position", speed)
        m.derivative("speed", (force - friction) / m.parameter("mass"))
        m.output("measured", m.site("encoder", position, "sensor", "offset", unit="m"))

    return Model(
        name="drive",
        states=(Quantity("position", "m", "", -1.0, 1.0, 0.05), Quantity("speed", "m/s", "", -2.0, 2.0, 0.05)),
        inputs=(Quantity("voltage", "V", "", -10.0, 10.0, 1.0),),
        parameters=(
            Parameter("viscous", 300.0, "N s/m", "guess", "Fv", 10.0, 2000.0, 50.0, role="estimated"),
            Parameter("mass", 90.0, "kg", "guess", "M", 20.0, 300.0, 10.0, role="estimated"),
        ),
        outputs=(Quantity("measured", "m", "", -1.0, 1.0, 0.05),),
        equations=equations,
        max_step_s=DT / 2,
        starts_steady=False,
        initial_guess={"position": 0.0, "speed": 0.0},
    )


def record(dry: float, rows: int = ROWS) -> Dataset:
    """A record with a dry friction of so many newtons."""
    time = DT * np.arange(rows, dtype=np.float64)
    plan = np.interp(time, [0, 1, 2, 4, 5, 7, 8, 9, 11, 12.5], [0, 0.06, 0.06, 0.2, 0.2, 0.1, 0.1, 0.02, 0.18, 0.05])
    position, speed, volts, h = 0.0, 0.0, 0.0, DT / STEPS
    held, seen = np.zeros((rows, 1)), np.zeros((rows, 1))
    for k in range(rows):
        seen[k], held[k] = position, volts
        volts = float(np.clip(2000.0 * (plan[k] - position) / GAIN - 10.0 * speed, -10.0, 10.0))
        for _ in range(STEPS):
            half = speed + h / 2 * (GAIN * volts - VISCOUS * speed - dry * np.tanh(speed / 1e-3)) / MASS
            position += h * half
            speed += h * (GAIN * volts - VISCOUS * half - dry * np.tanh(half / 1e-3)) / MASS
    seen += NOISE * np.random.default_rng(5).standard_normal(seen.shape)
    return Dataset("drive", time, DT, held, seen)


@pytest.mark.parametrize(("dry", "step"), [(15.0, DT / 2), (40.0, DT), (0.0, DT / 2)])
def test_dry_friction_is_named_with_its_size_and_only_where_it_is(dry: float, step: float) -> None:
    """A motor force that depends on the speed is the same term by another name, and has no reason for it.

    Where steps are too long for so sharp a jump, no run had it, and an encoder that answers late took its place.
    """
    verdict = discover(replace(drive(), max_step_s=step), record(dry)).verdict
    if not dry:
        assert verdict.word == "none", verdict.reason
        return
    assert verdict.word == "named", verdict.reason
    (told,) = verdict.effects
    assert (told.effect.site, told.effect.driver, told.effect.form) == ("friction", "speed", "direction")
    assert told.effect.coefficients["turn"] == pytest.approx(dry, rel=0.05)
    assert verdict.error[0].after < 1.5 * NOISE


def test_dry_friction_that_came_since_a_reference_has_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Single faults of the whole record find it; the search finds its size, to the noise of the encoder.

    The model alone explains nothing of such a record, and no regression does: it is an integrator. The reference has
    shown that it can.
    """
    monkeypatch.setattr(searched_change, "MOST_SECONDS", 600.0)  # a machine under load searches as far
    verdict = find_changes(drive(), [record(15.0, 1000)], [replace(record(0.0, 1000), name="old")]).verdict
    assert verdict.word == "named", verdict.reason
    (told,) = verdict.effects
    assert (told.effect.site, told.effect.driver, told.effect.form) == ("friction", "speed", "direction")
    assert told.effect.coefficients["turn"] == pytest.approx(15.0, rel=0.05)
    assert "has changed since the reference" in verdict.reason
