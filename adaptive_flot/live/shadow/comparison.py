"""One-step errors of a shadow and of the acting estimator on the same rows."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from adaptive_flot.contracts import Estimate
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.live.store.beside import ShadowResult

MOST_KEPT = 50
"""Cycles whose innovation is kept until the shadow's comes in."""


@dataclass(frozen=True)
class Compared:
    """Root mean square innovations over the rows that both have seen.

    Attributes
    ----------
    rows
        Number of rows.
    errors
        (output, acting, shadow) of each measured output, in its unit.
    """

    rows: int
    errors: tuple[tuple[str, float, float], ...]

    @property
    def worse(self) -> tuple[str, ...]:
        """Outputs whose error is larger in shadow by more than 2 %."""
        return tuple(name for name, acting, shadow in self.errors if shadow > 1.02 * acting)


class Comparison:
    """Sums of squares over the rows that both have seen.

    Parameters
    ----------
    outputs
        Names of the model's outputs.
    """

    def __init__(self, outputs: Sequence[str]) -> None:
        self._names = tuple(outputs)
        self._acting: OrderedDict[int, FloatArray] = OrderedDict()
        self._squares = np.zeros((2, len(self._names)))
        self._counts = np.zeros(len(self._names))

    def acting(self, cycle: int, estimate: Estimate) -> None:
        """The acting estimator's innovation of a cycle."""
        self._acting[cycle] = estimate.innovation
        while len(self._acting) > MOST_KEPT:
            self._acting.popitem(last=False)

    def shadow(self, result: ShadowResult) -> None:
        """The shadow's innovation of a cycle."""
        acting = self._acting.pop(result.cycle, None)
        if acting is None or result.estimate is None:
            return
        both = np.vstack([acting, result.estimate.innovation])
        seen = np.isfinite(both).all(axis=0)
        self._squares[:, seen] += both[:, seen] ** 2
        self._counts += seen

    def compared(self) -> Compared:
        """The comparison by now."""
        errors = []
        for j, name in enumerate(self._names):
            if self._counts[j]:
                acting, shadow = (math.sqrt(s / self._counts[j]) for s in self._squares[:, j])
                errors.append((name, acting, shadow))
        return Compared(int(self._counts.max(initial=0)), tuple(errors))
