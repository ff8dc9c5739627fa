"""The part of a sample that drives an estimator."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.contracts import Sample
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray


def driving_outputs(sample: Sample, columns: Sequence[int], count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """All outputs (ny,), the driving ones with 0 where missing (m,), and 1 for those that are there, else 0 (m,).

    Raises
    ------
    ModelError
        The sample does not have the model's number of outputs.
    """
    measured = np.asarray(sample.outputs, dtype=float)
    if measured.shape != (count,):
        raise ModelError(f"a sample has {measured.shape} outputs, the model ({count},)")
    driving = measured[columns]
    present = np.isfinite(driving)
    if not present.all():
        driving = np.where(present, driving, 0.0)
    return measured, driving, present.astype(float)
