"""What sensors and archives do to a record: noise with a memory, quanta, outliers, holes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.signal import lfilter

from benchmarks.other_processes.world import Columns, Rng

MEMORY = (0.0, 0.8)
"""Memory of the noise from one row to the next."""
SIZE = (0.6, 1.5)
"""Factor of its standard deviation."""
QUANTA = (0.0, 1.0, 2.0)
"""Smallest step of a sensor, in standard deviations of its noise; 0 for none."""
OUTLIERS = (0.0, 0.004)
"""Share of rows."""
HOLES, HOLE_ROWS = (0, 3), (2, 30)


def measured(rng: Rng, clean: Columns, noise: Mapping[str, float]) -> Columns:
    """The columns as they are archived; an empty cell is a missing value."""
    seen = dict(clean)
    for name, std in noise.items():
        count, memory = len(clean[name]), float(rng.uniform(*MEMORY))
        e = np.asarray(lfilter([np.sqrt(1 - memory**2)], [1.0, -memory], rng.standard_normal(count)), dtype=float)
        hit = rng.random(count) < rng.uniform(*OUTLIERS)
        far = rng.uniform(6, 20, count) * rng.choice([-1.0, 1.0], count)
        values = clean[name] + std * float(rng.uniform(*SIZE)) * np.where(hit, far, e)
        quantum = std * float(rng.choice(QUANTA))
        values = quantum * np.round(values / quantum) if quantum > 0 else values
        for _ in range(int(rng.integers(HOLES[0], HOLES[1] + 1))):
            long = int(rng.integers(HOLE_ROWS[0], HOLE_ROWS[1] + 1))
            first = int(rng.integers(20, count - long - 20))
            values[first : first + long] = np.nan
        seen[name] = values
    return seen
