"""The least-squares problem of a batch fit: centre, scale and range of what is unknown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar, cast

from adaptive_flot.greybox.model import FloatArray

KEPT_EVALUATIONS = 6
"""Start, outputs and derivatives at the last two points of a search."""

_T = TypeVar("_T")


@dataclass(frozen=True)
class Problem:
    """Least squares in scaled unknowns z: q parameters, then the free states at the first row.

    Attributes
    ----------
    centre, scale
        The unknowns are (value - centre) / scale.
    lower, upper
        Range of z.
    prior_std
        Standard deviation of the prior of z, infinite for none.
    steady
        Start (nx,) of the states that are not free.
    """

    centre: FloatArray
    scale: FloatArray
    lower: FloatArray
    upper: FloatArray
    prior_std: FloatArray
    steady: FloatArray
    seen: dict[tuple[str, bytes], Any] = field(default_factory=dict, repr=False)
    """What was evaluated last, by unknowns."""

    def anew(self) -> Problem:
        """The same problem for another record: nothing of it was evaluated yet."""
        return replace(self, seen={})

    def once(self, what: str, unknowns: FloatArray, evaluate: Callable[[], _T]) -> _T:
        """Evaluate once for the same unknowns: each search starts, and is judged, where the one before ended."""
        key = (what, unknowns.tobytes())
        if key not in self.seen:
            self.remember(what, unknowns, evaluate())
        return cast(_T, self.seen[key])

    def remember(self, what: str, unknowns: FloatArray, value: object) -> None:
        """Keep what was evaluated elsewhere, in the place of what was kept for longest."""
        if len(self.seen) == KEPT_EVALUATIONS:
            del self.seen[next(iter(self.seen))]
        self.seen[what, unknowns.tobytes()] = value


@dataclass(frozen=True)
class Search:
    """Where the search from one start has ended.

    Attributes
    ----------
    unknowns
        Unknowns z there.
    noise
        Standard deviation of what is left of each output (m,).
    evaluations
        Simulations of the record.
    converged
        Whether it came to an end by itself.
    criterion
        Minus two log-likelihood and prior, 2 sum_j N_j log s_j + sum (z / prior_std)^2; infinite where the model can
        not simulate the record from the start.
    """

    unknowns: FloatArray
    noise: FloatArray
    evaluations: int
    converged: bool
    criterion: float
