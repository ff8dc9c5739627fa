"""A water heater of the benchmark's model, simulated apart from it: it fouls, or its thermometer sits in a well."""

from __future__ import annotations

from typing import Literal

import numpy as np

from adaptive_flot.greybox import Dataset
from benchmarks.other_processes.plants.heat_exchanger import DT
from tests.discovery.heated import moves

UA, HOLDUP, INLET = 2.6, 45.0, 15.0
FOULED, BEGINS, ENDS, LATE = 0.3, 1500.0, 2400.0, 60.0
Wrong = Literal["nothing", "fouls", "late"]


def record(wrong: Wrong, rows: int = 600, seed: int = 0) -> Dataset:
    """Euler, five steps a row; the steam wanders a little about what is asked."""
    rng = np.random.default_rng(seed)
    inputs = np.column_stack([moves(rows, 0.8, 2.2, 25, seed + 100), moves(rows, 105.0, 130.0, 35, seed + 200)])
    water = shown = 60.0
    bubbles, y = 0.0, np.zeros(rows)
    for k, (flow, steam) in enumerate(inputs):
        bubbles += (0.3 * np.sqrt(2 * DT / 300.0) * rng.normal()) - bubbles * DT / 300.0
        for j in range(5):
            t = (k + j / 5) * DT
            fouled = FOULED * np.clip((t - BEGINS) / (ENDS - BEGINS), 0.0, 1.0) if wrong == "fouls" else 0.0
            heat = UA * (1 - fouled) * (steam + bubbles - water)
            water += DT / 5 * (heat - 4.19 * flow * (water - INLET)) / (4.19 * HOLDUP)
            shown += DT / 5 * (water - shown) / LATE
        y[k] = (shown if wrong == "late" else water) + 0.1 * rng.normal()
    inputs = np.column_stack([inputs, np.full(rows, INLET)])
    return Dataset("exchanger", DT * np.arange(1.0, rows + 1), DT, inputs, y[:, None])
