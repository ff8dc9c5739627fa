"""Records of many members at the same instants: what an estimator takes that tracks all of them at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeGuard

import numpy as np

from adaptive_flot.contracts.track import Track
from adaptive_flot.greybox.model import FloatArray


@dataclass(frozen=True)
class EnsembleRecord:
    """Samples of M members, N each, at the same instants; member m and row k belong together in all of them.

    Attributes
    ----------
    time
        (N,) [s].
    inputs, outputs
        (M, N, nu) and (M, N, ny); outputs NaN where missing.
    parameters
        What is known of the parameters (M, N, np), see `Sample.parameters`; None where nothing is.
    """

    time: FloatArray
    inputs: FloatArray
    outputs: FloatArray
    parameters: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.outputs)

    def times_before(self, starts: Sequence[float]) -> FloatArray:
        """Time (M, N, 1) at which the interval of each sample begins [s]; `starts` is that of the first, by member."""
        members = np.asarray(starts, dtype=float)[:, None]
        return np.concatenate([members, np.broadcast_to(self.time[:-1], (len(members), len(self.time) - 1))], axis=1)[
            ..., None
        ]


class TracksEnsembles(Protocol):
    """An estimator that tracks many members at once, each as `track` or `update` would alone (to 1e-9)."""

    def track_ensemble(self, states: Sequence[Any], record: EnsembleRecord) -> list[tuple[Any, Track]]:
        """State after the last sample, and the estimates, of each member.

        Parameters
        ----------
        states
            Of each member before its first sample.
        record
            Their samples.
        """
        ...


def tracks_ensembles(estimator: object) -> TypeGuard[TracksEnsembles]:
    """Whether an estimator tracks ensembles as it updates: not where a derived class has an `update` of its own."""
    first = {
        name: next((c for c in type(estimator).__mro__ if name in vars(c)), None)
        for name in ("update", "track_ensemble")
    }
    return first["track_ensemble"] is not None and first["update"] is first["track_ensemble"]
