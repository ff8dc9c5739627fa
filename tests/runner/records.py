"""Simulated plant records with known truth, as tables that the command line reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.runner.commands.record_blocks import Blocks
from adaptive_flot.runner.commands.simulate import simulate_record

NOISE: Mapping[str, float] = {"concentrate_grade": 1e-3, "level": 5e-4}
TRUTH: Mapping[str, float] = {"n": 1.04, "C": 6.7e-4}


@dataclass(frozen=True)
class PlantRecord:
    """A record of the cell: the simulated table without noise, and what is measured."""

    truth: pd.DataFrame
    table: pd.DataFrame
    dataset: Dataset

    def blocks(self, cut: int) -> Blocks:
        return Blocks("plant", self.dataset.rows(0, cut), self.dataset.rows(cut - 1), continues=True)


def changing_inputs(rows: int, seed: int = 4) -> FloatArray:
    """Random air every 20 s and level set-point every 40 s over the range of the paper."""
    generator = np.random.default_rng(seed)
    air = np.repeat(generator.uniform(9.5e-4, 2.1e-3, rows // 20 + 1), 20)[:rows]
    level = np.repeat(generator.uniform(0.34, 0.42, rows // 40 + 1), 40)[:rows]
    return np.column_stack([air, np.full(rows, 1.67e-4), level])


def plant_record(model: Model, rows: int = 240, seed: int = 5) -> PlantRecord:
    """Grade and level of a cell with n = 1.04 and C = 6.7e-4, noisy, with a few measurements missing."""
    inputs, time = changing_inputs(rows), np.arange(rows, dtype=float)
    blank = np.full((rows, len(model.outputs)), np.nan)
    truth = simulate_record(Dataset("truth", time, 1.0, inputs, blank), model.with_parameters(TRUTH))
    generator = np.random.default_rng(seed)
    measured = truth[["time_s", *(q.column for q in model.inputs)]].copy()
    outputs = blank.copy()
    for name, std in NOISE.items():
        q = model.outputs[model.index("outputs", name)]
        values = truth[q.column].to_numpy(dtype=float) + std * generator.standard_normal(rows)
        values[generator.integers(0, rows, 6)] = np.nan
        measured[q.column] = values
        outputs[:, model.index("outputs", name)] = values
    return PlantRecord(truth, measured, Dataset("plant", time, 1.0, inputs, outputs))
