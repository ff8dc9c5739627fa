"""Protects a search against the errors of an integration: of a model whose own steps are too long for the record.

Its plant is the solution of the same equations, so that nothing is missing. In its own steps the model runs off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from adaptive_flot.discovery import discover as module
from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.results import FirstRound, State, Verdict
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


def test_shorter_steps_are_asked_for_once_the_best_single_effect_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """A search of a lag went through all stages in steps of 1 s, and then again in steps of 0.25 s."""
    given = model()
    finer = replace(given, max_step_s=given.max_step_s / 4)
    done: list[tuple[str, float]] = []

    def stage(name: str) -> Callable[[State], State | Verdict]:
        def step(state: State) -> State | Verdict:
            done.append((name, state.model.max_step_s))
            if name == "conclude":
                return Verdict("none", "", notes=state.screening.record.notes)
            return replace(state, first=cast(FirstRound, object()) if name == "single effects" else state.first)

        return step

    monkeypatch.setattr(module, "STAGES", tuple(map(stage, ("fit", "single effects", "conclude"))))
    monkeypatch.setattr(module, "_finer_for_one", lambda state: finer if state.model is given else None)
    monkeypatch.setattr(module, "_finer", lambda state, verdict: None)
    rows = np.arange(40, dtype=float)
    verdict = discover(given, Dataset("coil", rows, 1.0, rows[:, None], rows[:, None])).verdict
    assert [name for name, _ in done] == ["fit", "single effects"] * 2 + ["conclude"]
    assert {length for _, length in done[2:]} == {finer.max_step_s}
    assert len(verdict.notes) == 1 and "too long for this record" in verdict.notes[0]
