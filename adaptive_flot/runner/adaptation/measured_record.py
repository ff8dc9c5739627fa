"""The record of a running loop, as a search is given it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.contracts import Setup
from adaptive_flot.contracts.delayed_measurements import in_time
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.runner.loop.loop import Step


def measured_record(steps: Sequence[Step], setup: Setup) -> Dataset:
    """What the instruments have shown until now, delayed values in their places: no truth of the plant enters."""
    samples = in_time([s.plant.sample for s in steps], setup)
    return Dataset(
        name="measured in the loop",
        time=np.array([s.time for s in samples]),
        dt=setup.dt,
        inputs=np.vstack([s.inputs for s in samples]),
        outputs=np.vstack([s.outputs for s in samples]),
    )
