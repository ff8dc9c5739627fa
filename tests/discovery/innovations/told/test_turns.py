"""Protects what turns with a sign in innovations form: dry friction of a mass on a spring, on a floor that shakes.

The record comes from equations of its own. Without dry friction the same search must not find any.
"""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.innovations.in_words import told_in_words
from adaptive_flot.discovery.innovations.judge import judge
from adaptive_flot.discovery.innovations.search.beam import best_explanations
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope

DT, ROWS, STEPS = 0.05, 700, 40
STIFFNESS, DAMPING, GAIN = 12.0, 1.0, 30.0
"""Over the mass: spring [1/s2], slide [1/s], coil [mm/s2/V]."""
DRY, SHAKES, NOISE = 12.0, 4.0, 0.02
"""Dry friction and the standard deviation of the floor's push, a value a row [mm/s2]; noise of the gauge [mm]."""


def mass() -> Model:
    """A mass on a spring with viscous friction only, a factor at its site."""

    def equations(m: Scope) -> None:
        position, speed = m.state("position"), m.state("speed")
        coil = m.site("coil", GAIN * m.input("volts"), "actuator", unit="mm/s2")
        spring = m.site("spring", m.parameter("stiffness") * position, unit="mm/s2")
        friction = m.site("friction", m.parameter("damping") * speed, unit="mm/s2")
        m.derivative("position", speed)
        m.derivative("speed", coil - spring - friction)
        m.output("measured", m.site("gauge", position, "sensor", "offset", unit="mm"))

    return Model(
        name="mass",
        states=(Quantity("position", "mm", "", scale=5.0), Quantity("speed", "mm/s", "", scale=15.0)),
        inputs=(Quantity("volts", "V", "", -5.0, 5.0),),
        parameters=(
            Parameter("stiffness", STIFFNESS, "1/s2", "given", "k", 0.1, 100.0, 1.0, role="estimated"),
            Parameter("damping", DAMPING, "1/s", "given", "d", 0.01, 20.0, 0.2, role="estimated"),
        ),
        outputs=(Quantity("measured", "mm", "", scale=5.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"position": 0.0, "speed": 0.0},
    )


def record(dry: float) -> Dataset:
    """A record with a dry friction of so much a mass [mm/s2]."""
    rng = np.random.default_rng(12)
    volts = np.repeat(rng.uniform(-3.0, 3.0, ROWS // 20), 20)
    push = SHAKES * rng.standard_normal(ROWS)
    x, v, h = 0.0, 0.0, DT / STEPS
    seen = np.zeros(ROWS)
    for k in range(1, ROWS):
        for _ in range(STEPS):
            v += h * (GAIN * volts[k] + push[k] - STIFFNESS * x - DAMPING * v - dry * np.tanh(v / 0.5))
            x += h * v
        seen[k] = x
    seen += NOISE * rng.standard_normal(ROWS)
    return Dataset("mass", DT * np.arange(ROWS, dtype=float), DT, volts[:, None], seen[:, None])


@pytest.mark.parametrize("dry", [DRY, 0.0])
def test_dry_friction_is_told_with_its_size_though_the_floor_shakes(dry: float) -> None:
    """The friction of the model is a factor on a speed; what turns with its sign is added to it."""
    model, data = mass(), record(dry)
    search = Search(model, data, (0,), noise_floor([data], (0,)), ("stiffness", "damping"))
    with np.errstate(all="ignore"):
        base = search.base(model.parameter_values)
        told = judge(search, base, best_explanations(search, base))
    if not dry:
        assert told.word not in ("named", "class"), told_in_words(search, told)
        return
    assert told.word == "named", told_in_words(search, told)
    (h,) = told.certain
    assert (h.site, h.driver, h.kind) == ("friction", "speed", "turns")
    fitted = search.model_of(told.best)
    turn = fitted.parameters[fitted.index("parameters", h.effect.parameter("turn"))].value
    assert turn == pytest.approx(dry, rel=0.15)
    assert "depends on the sign of speed" in told_in_words(search, told)
