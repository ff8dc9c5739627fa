"""Protects a search against the errors of an integration: of a model whose own steps are too long for the record.

Its plant is the solution of the same equations, so that nothing is missing. In its own steps the model runs off.
"""

from __future__ import annotations

import numpy as np

from adaptive_flot.discovery.discover import discover
from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope

TAU, GAIN, ROWS, NOISE = 0.3, 2.0, 600, 0.02


def model() -> Model:
    """A coil between its voltage and its current; rows are one second apart, more than three time constants."""

    def equations(m: Scope) -> None:
        current = m.state("current")
        volts = m.site("supply", m.input("voltage"), "actuator", "offset", unit="V")
        m.derivative("current", (m.parameter("gain") * volts - current) / m.parameter("tau"))
        m.output("measured", m.site("ammeter", current, "sensor", "offset", unit="A"))

    return Model(
        name="coil",
        states=(Quantity("current", "A", "", -20.0, 20.0, 1.0),),
        inputs=(Quantity("voltage", "V", "", -10.0, 10.0, 1.0),),
        parameters=(
            Parameter("tau", 0.25, "s", "guess", "tau", 0.01, 10.0, 0.1, role="estimated"),
            Parameter("gain", 1.5, "A/V", "guess", "K", 0.1, 10.0, 1.0, role="estimated"),
        ),
        outputs=(Quantity("measured", "A", "", -20.0, 20.0, 1.0),),
        equations=equations,
    )


def test_a_model_that_runs_off_in_its_own_steps_is_judged_in_shorter_ones() -> None:
    """It was `insufficient`: the model can not simulate the record."""
    rng = np.random.default_rng(8)
    u = np.repeat(rng.uniform(-3.0, 3.0, ROWS // 4), 4)
    x, a = np.zeros(ROWS), np.exp(-1.0 / TAU)
    x[0] = GAIN * u[0]
    for k in range(1, ROWS):
        x[k] = a * x[k - 1] + (1 - a) * GAIN * u[k]
    y = x + NOISE * rng.standard_normal(ROWS)
    verdict = discover(model(), Dataset("coil", np.arange(ROWS, dtype=float), 1.0, u[:, None], y[:, None])).verdict
    assert verdict.word == "none", verdict.reason
    assert abs(verdict.parameters["K"] / GAIN - 1) < 0.01
    assert any("too long for this record" in note for note in verdict.notes)
