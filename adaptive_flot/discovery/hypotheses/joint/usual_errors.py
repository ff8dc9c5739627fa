"""How large a model's errors usually are, from its reference records: elsewhere in its range, otherwise large.

A model is never equally good everywhere: a plant at rest, or one that starts, is often described badly. An error counts
by what is usual where the plant is, so that what the model never explained is not told as a change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from adaptive_flot.discovery.hypotheses.joint.rows import Rows
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray

NEIGHBOURS = 0.05
"""Share of the reference rows that are a row's neighbours."""
FEWEST_NEIGHBOURS = 20
RMS_OF_MEDIAN = 1.4826
TRIMMED = 0.98
"""Errors count up to this quantile of their absolute values."""


@dataclass(frozen=True)
class UsualErrors:
    """Sizes of the reference's errors, by where the plant is.

    Attributes
    ----------
    tree
        The reference rows by their inputs, each over its range.
    magnitudes
        Absolute errors of these rows (n, m).
    overall
        Their root mean square over all rows (m,), without the few largest: what an error counts by.
    rms
        The same with the largest (m,): what root mean square errors of other records are compared with.
    low, width
        Range of the inputs (nu,).
    """

    tree: KDTree
    magnitudes: FloatArray
    overall: FloatArray
    rms: FloatArray
    low: FloatArray
    width: FloatArray

    def sizes(self, record: Dataset) -> FloatArray:
        """Usual size of each output's error in every row of a record (N, m).

        It is 1.4826 times the median of the neighbours, and at least what is usual over all rows: a plant at rest is
        easily described, and says little about how well the model describes it elsewhere.
        """
        count = min(max(FEWEST_NEIGHBOURS, int(NEIGHBOURS * len(self.magnitudes))), len(self.magnitudes))
        _, near = self.tree.query((record.inputs - self.low) / self.width, count)
        near = np.asarray(near).reshape(len(record), -1)
        with np.errstate(all="ignore"):
            local = RMS_OF_MEDIAN * np.nanmedian(self.magnitudes[near], axis=1)
        return np.maximum(np.where(np.isfinite(local), local, self.overall), self.overall)


def overall_sizes(rows: Rows, errors: Sequence[FloatArray], floor: FloatArray) -> FloatArray:
    """Root mean square of each output's errors (m,) without the few largest, and at least `floor`."""
    together = np.abs(np.concatenate([e[c] for e, c in zip(errors, rows.counted, strict=True)]))
    with np.errstate(all="ignore"):
        together = np.minimum(together, np.nanquantile(together, TRIMMED, axis=0))
        size = np.sqrt(np.nanmean(together**2, axis=0))
    sizes: FloatArray = np.maximum(np.nan_to_num(size), floor)
    return sizes


def usual_errors(
    rows: Rows, errors: Sequence[FloatArray], floor: FloatArray, others: Sequence[Dataset] = ()
) -> UsualErrors:
    """Errors of reference records by their inputs.

    Parameters
    ----------
    rows
        The reference.
    errors
        Its errors, an array (N, m) a record.
    floor
        Noise of each output (m,).
    others
        Records that will be asked about: their inputs widen the range over which distances are measured.
    """
    inputs = np.concatenate([r.inputs[c] for r, c in zip(rows.records, rows.counted, strict=True)])
    magnitudes = np.abs(np.concatenate([e[c] for e, c in zip(errors, rows.counted, strict=True)]))
    every = np.concatenate([inputs, *(r.inputs for r in others)])
    low, width = every.min(axis=0), np.ptp(every, axis=0)
    width = np.where(width > 0, width, 1.0)
    overall = overall_sizes(rows, errors, floor)
    with np.errstate(all="ignore"):
        together = np.maximum(np.nan_to_num(np.sqrt(np.nanmean(magnitudes**2, axis=0))), overall)
    return UsualErrors(KDTree((inputs - low) / width), magnitudes, overall, together, low, width)
