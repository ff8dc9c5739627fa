"""Records of many members at once, each as `update` would take it alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from adaptive_flot.contracts import Estimate, Sample, Setup, Status
from adaptive_flot.contracts.ensemble_record import EnsembleRecord
from adaptive_flot.contracts.track import Track
from adaptive_flot.greybox.ensemble.lanes import Lanes
from adaptive_flot.greybox.model import FloatArray
from estimators.adaptive_imm.state import LAST, MORE_LIKELY, AdaptiveImmState, NoiseLevel
from estimators.adaptive_imm.step import CARRIED
from estimators.shared.coordinates import Coordinates
from estimators.shared.ensemble import Flags, driving, known_parameters, samples_of, statuses
from estimators.shared.joint_filter import Layout, of_coordinates

EVERY = ("found", "prediction", "std", "mean", "covariance", "projected", "finite")
"""Results that are wanted at every sample."""


class OneByOne(Protocol):
    """What is asked of the estimator: its parts, and how it takes a sample alone."""

    setup: Setup
    coordinates: Coordinates
    layout: Layout
    columns: list[int]
    off: FloatArray

    @property
    def lanes(self) -> Lanes:
        """The step for many members."""

    def is_far(self, mean: FloatArray, covariance: FloatArray) -> Flags:
        """Whether a parameter is beyond what is plausible (N,)."""

    def update(self, state: AdaptiveImmState, sample: Sample) -> tuple[AdaptiveImmState, Estimate]:
        """See `Estimator.update`."""


def track_members(
    estimator: OneByOne, states: Sequence[AdaptiveImmState], record: EnsembleRecord
) -> list[tuple[AdaptiveImmState, Track]]:
    """State after the last sample, and the estimates, of each member; see `TracksEnsembles`."""
    parameters = known_parameters(record, estimator.setup.model.parameter_values)
    measured, present = driving(record, estimator.columns)
    fixed = {
        **{name: np.array([getattr(s, name) for s in states]) for name in ("z", "P", "probability", "lagged", "slow")},
        **{name: np.array([getattr(s.noise, name) for s in states]) for name in ("variance", "count", "least")},
        "doubt": np.array([[s.trust.doubt] for s in states]),
        **parameters["fixed"],
    }
    by_row = {
        "t": record.times_before([s.time for s in states]),
        "u": record.inputs,
        "driving": measured,
        "present": present,
        **parameters["by_row"],
    }
    rows = estimator.lanes(len(record), len(record.time), fixed, by_row, every=EVERY, last=_CARRIED_ON)
    seen: Flags = np.asarray(present.max(axis=2) > 0)
    return [
        _member(estimator, {name: values[m] for name, values in rows.items()}, states[m], record, m, seen[m])
        for m in range(len(states))
    ]


_CARRIED_ON = tuple(result for result in CARRIED.values() if result not in EVERY)


def _member(
    estimator: OneByOne,
    rows: Mapping[str, FloatArray],
    state: AdaptiveImmState,
    record: EnsembleRecord,
    m: int,
    present: Flags,
) -> tuple[AdaptiveImmState, Track]:
    """State after the samples and estimates of one member."""
    if not np.isfinite(rows["finite"]).all():  # a sample to be skipped made all that came after it NaN
        estimates = []
        for sample in samples_of(record, m):
            state, estimate = estimator.update(state, sample)
            estimates.append(estimate)
        return state, Track.of(estimates)
    shape, q = estimator.layout, len(estimator.setup.parameters)
    mean, covariance = rows["mean"], rows["covariance"]
    theta, theta_covariance = of_coordinates(mean[:, shape.coordinates], covariance, estimator.coordinates)
    wrong, course = state.wrong, np.empty(len(mean))
    for k, now in enumerate((rows["found"] @ estimator.off).tolist()):
        wrong += (now - wrong) / LAST
        course[k] = wrong
    found = statuses(rows["projected"][:, 0] > 0, present)
    told = (course > MORE_LIKELY) | estimator.is_far(mean, covariance)
    track = Track(
        record.time,
        rows["prediction"],
        rows["std"],
        theta[:, :q],
        state.trust.shown(theta_covariance[:, :q, :q]),
        mean[:, : shape.nx],
        tuple(Status.MODEL_ERROR if t and s is Status.OK else s for s, t in zip(found, told.tolist(), strict=True)),
    )
    noise = NoiseLevel(rows["level"].copy(), rows["counted"].copy(), state.noise.least)
    last = AdaptiveImmState(
        float(record.time[-1]),
        rows["z_next"].copy(),
        rows["P_next"].copy(),
        rows["found"][-1].copy(),
        rows["followed"].copy(),
        noise,
        rows["slowly"].copy(),
        covariance[-1].copy(),
        state.trust,
        wrong,
    )
    return last, track
