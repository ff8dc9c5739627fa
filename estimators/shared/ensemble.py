"""What the estimators have in common that track many members at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from adaptive_flot.contracts import Sample, Status
from adaptive_flot.contracts.ensemble_record import EnsembleRecord
from adaptive_flot.greybox.model import FloatArray

Flags = NDArray[np.bool_]


def driving(record: EnsembleRecord, columns: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Outputs (M, N, m) of some columns, 0 where missing, and 1 for those that are there, else 0."""
    measured = record.outputs[..., list(columns)]
    present = np.isfinite(measured)
    return np.where(present, measured, 0.0), present.astype(float)


def known_parameters(record: EnsembleRecord, usual: FloatArray) -> dict[str, dict[str, FloatArray]]:
    """Parameters as `Lanes` takes them: `usual` (np,) for all, or what the record knows, row by row."""
    if record.parameters is None:
        return {"fixed": {"p": usual}, "by_row": {}}
    return {"fixed": {}, "by_row": {"p": record.parameters}}


def samples_of(record: EnsembleRecord, member: int) -> list[Sample]:
    """The samples of one member."""
    known = record.parameters
    return [
        Sample(
            float(t),
            record.inputs[member, k],
            record.outputs[member, k],
            (),
            None if known is None else known[member, k],
        )
        for k, t in enumerate(record.time.tolist())
    ]


_BY_CODE = np.array([Status.MISSING, Status.OK, Status.PROJECTED], dtype=object)


def statuses(projected: Flags, present: Flags) -> tuple[Status, ...]:
    """Status of each sample (N,), whose result is finite."""
    return tuple(_BY_CODE[np.where(projected, 2, present)].tolist())
