"""The bias of an output: filtered measured minus predicted value, which a controller adds to its predictions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from adaptive_flot.contracts import Estimate


@dataclass(frozen=True)
class OutputBias:
    """A first-order filter of the innovations of one output.

    Attributes
    ----------
    output, index
        Name of the output, and its index among the outputs.
    dt
        Sampling interval [s].
    time_constant
        Of the filter [s].
    """

    output: str
    index: int
    dt: float
    time_constant: float

    def after(self, bias: float, heard: float, estimate: Estimate) -> tuple[float, float]:
        """Bias and time of its newest value [s] after an estimate."""
        return self._filtered(bias, heard, estimate.time, self._newest(estimate))

    def corrected(self, estimate: Estimate, bias: float) -> float:
        """The output as it is now: what the model alone predicts, and the bias; free of most of the noise."""
        predicted = float(estimate.prediction[self.index])
        return predicted + bias - (0.0 if estimate.discrepancy is None else float(estimate.discrepancy[self.index]))

    def change(self, known: Sequence[Estimate], again: Sequence[Estimate]) -> float:
        """What the filter would show more had it been given other estimates `again` of the samples of `known`.

        The filter is linear, so this is the filtered difference of the innovations: zero where there is none.
        """
        bias, heard = 0.0, known[0].time - self.dt if known else 0.0
        for old, new in zip(known, again, strict=True):
            bias, heard = self._filtered(bias, heard, old.time, self._newest(new) - self._newest(old))
        return bias

    def _newest(self, estimate: Estimate) -> float:
        """Measured minus what the model alone predicted, the newest of an estimate; NaN where there is none."""
        innovation = float(estimate.innovation[self.index])
        delayed = [v.value for v in estimate.delayed if v.output == self.output]
        newest = delayed[-1] if delayed and not np.isfinite(innovation) else innovation
        return newest if estimate.discrepancy is None else newest + float(estimate.discrepancy[self.index])

    def _filtered(self, bias: float, heard: float, time: float, innovation: float) -> tuple[float, float]:
        """One innovation later; after a gap, one value counts for the time since the last one, NaN for nothing."""
        if not np.isfinite(innovation):
            return bias, heard
        memory = float(np.exp(-max(time - heard, self.dt) / self.time_constant))
        return memory * bias + (1 - memory) * innovation, time
