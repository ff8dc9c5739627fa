"""An oracle: it knows the term and its shape, and fits n, C and the amplitudes to the first 60 %."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.hidden_effects.cell.equations import World
from benchmarks.hidden_effects.cell.simulate import Array, SimulationError, replay
from benchmarks.hidden_effects.cell.sites import INPUTS, OUTPUTS
from benchmarks.hidden_effects.effects.spec import Spec, influence
from benchmarks.hidden_effects.generate.ground_truth import spec_of
from benchmarks.hidden_effects.generate.nominal_fit import BURN_IN
from benchmarks.hidden_effects.plant.sensors import SensorEffect
from benchmarks.hidden_effects.rivals.base import noise_of

_STEPS = 4


def predict(specs: Sequence[Spec], theta: Array, inputs: Array, start: Sequence[float]) -> dict[str, Array]:
    """Outputs (N,) through the sensors with ln n, ln C and a factor of each amplitude in theta (2 + effects,)."""
    scaled = [replace(s, amplitude=s.amplitude * float(f)) for s, f in zip(specs, theta[2:], strict=True)]
    inside = tuple(influence(s, inputs[0].tolist()) for s in scaled if s.in_equations)
    columns = replay(World(float(np.exp(theta[0])), float(np.exp(theta[1])), inside), inputs, start)
    for effect in (SensorEffect(s) for s in scaled if not s.in_equations):
        y = columns[effect.output]
        rows = ({k: float(v[i]) for k, v in columns.items()} for i in range(len(y)))
        columns[effect.output] = np.array([effect(i + 1.0, float(y[i]), row) for i, row in enumerate(rows)])
    return columns


def judge(record: Path, answer_file: Path) -> dict[str, Any]:
    """The right verdict, with the error that the true term leaves."""
    answer = json.loads(answer_file.read_text())
    table = pd.read_csv(record)
    inputs = table[list(INPUTS)].to_numpy(dtype=np.float64)
    measured = {name: table[name].to_numpy(dtype=np.float64) for name in OUTPUTS if name in table}
    noise = {name: noise_of(y) for name, y in measured.items()}
    specs = [spec_of(effect) for effect in answer["effects"]]
    theta = np.array([np.log(answer["n"]), np.log(answer["C"]), *(1.0 for _ in specs)])
    fitted = slice(BURN_IN, int(0.6 * len(table)))
    best = _fit(specs, theta, inputs, answer["start"], measured, noise, fitted)
    report = slice(int(0.8 * len(table)), None)
    error = {
        name: {"after": float(np.sqrt(np.nanmean((y - best[name])[report] ** 2))), "block": "report"}
        for name, y in measured.items()
    }
    effects = [
        {"site": s.site, "driver": s.driver, "parameters": {"factor": f}} for s, f in zip(specs, theta[2:], strict=True)
    ]
    return {"verdict": answer["verdict"], "effects": effects, "error": error}


def _fit(
    specs: Sequence[Spec], theta: Array, inputs: Array, start: Sequence[float], measured: dict[str, Array],
    noise: dict[str, float], rows: slice,
) -> dict[str, Array]:  # fmt: skip
    """Gauss-Newton from the truth's own values, by differences; the last values that lowered the sum of squares."""

    def stack(columns: dict[str, Array]) -> Array:
        return np.concatenate([columns[name][rows] / noise[name] for name in measured])

    y = stack(measured)
    used = np.isfinite(y)
    best = predict(specs, theta, inputs, start)
    for _ in range(_STEPS):
        now = stack(best)
        J = np.empty((len(y), len(theta)))
        for j in range(len(theta)):
            moved = theta + 5e-3 * np.eye(len(theta))[j]
            J[:, j] = (stack(predict(specs, moved, inputs, start)) - now) / 5e-3
        step = np.linalg.lstsq(J[used], (y - now)[used], rcond=None)[0]
        trial = theta + np.clip(step, -0.2, 0.2)
        try:
            predicted = predict(specs, trial, inputs, start)
        except SimulationError:
            break
        old, new = (float(np.mean((y - s)[used] ** 2)) for s in (now, stack(predicted)))
        if new >= old:
            break
        theta, best = trial, predicted
        if old - new < 1e-3 * old:
            break
    return best
