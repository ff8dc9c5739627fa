"""RPEM for many members at once, side by side in vector registers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from adaptive_flot.contracts import Setup, Status
from adaptive_flot.contracts.ensemble_record import EnsembleRecord
from adaptive_flot.contracts.track import Track
from adaptive_flot.greybox.ensemble.lanes import Lanes
from adaptive_flot.greybox.model import FloatArray
from estimators.rpem.state import RpemState
from estimators.rpem.update import UpdateOptions
from estimators.shared.ensemble import Flags, driving, known_parameters, statuses
from estimators.shared.information import Information
from estimators.shared.state_correction import StateCorrection

MATRICES = ("S", "covariance", "free", "gain", "S_next", "covariance_next", "information")
RESULTS = ("prediction", "expected_std", "theta_next", "covariance_next", "x_next", "flags")


class RpemEnsemble:
    """The update of `Rpem` for M members.

    Parameters
    ----------
    setup, options, correction, information, update
        Those of the estimator.
    """

    def __init__(
        self,
        setup: Setup,
        options: UpdateOptions,
        correction: StateCorrection,
        information: Information | None,
        update: ca.Function,
    ) -> None:
        self._setup, self._correction, self._information = setup, correction, information
        self._columns = setup.model.indices("outputs", setup.outputs)
        carried = {"x": "x_next", "theta": "theta_next", "covariance": "covariance_next"}
        self._recursive = options.gradient == "recursive"
        if self._recursive:
            carried["S"] = "S_next"
        self._lanes = Lanes(update, carried, MATRICES, as_machine_code=setup.model.compiled)

    def __call__(self, states: Sequence[RpemState], record: EnsembleRecord) -> list[tuple[RpemState, Track] | None]:
        """State after the samples and estimates of each member; None for one with a sample to be skipped.

        Such a sample (NOT_FINITE) makes all that come after it NaN, but in the freezing recursion, which goes sample by
        sample anyway.
        """
        states = [self._started(state, record, m) for m, state in enumerate(states)]
        if self._information is not None:
            return list(self._by_samples(states, record, self._information))
        every = [*RESULTS, "S_next"] if self._recursive else list(RESULTS)
        fixed, by_row = self._arguments(states, record)
        rows = self._lanes(len(record), len(record.time), fixed, by_row, every=every)
        flags, tracked = rows["flags"], list[tuple[RpemState, Track] | None]()
        for m, state in enumerate(states):
            if not np.isfinite(flags[m, :, 0]).all():
                tracked.append(None)
                continue
            track = _track(
                record.time, {name: rows[name][m] for name in RESULTS}, statuses(flags[m, :, 1] > 0, flags[m, :, 2] > 0)
            )
            last = rows["S_next"][m, -1].copy() if self._recursive else state.sensitivity
            tracked.append((_after(state, track, last, state.information), track))
        return tracked

    def _started(self, state: RpemState, record: EnsembleRecord, member: int) -> RpemState:
        """The state with the gain of its state correction, designed for the operating point of the first sample."""
        if not self._correction.outputs or state.correction is not None:
            return state
        known = record.parameters
        p = self._setup.model.parameter_values if known is None else known[member, 0]
        design = self._correction.design(state.x, state.time, record.inputs[member, 0], p, state.theta)
        return replace(state, correction=design)

    def _arguments(
        self, states: Sequence[RpemState], record: EnsembleRecord
    ) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
        """Arguments that stay, and those of each row."""
        measured, present = driving(record, self._columns)
        parameters = known_parameters(record, self._setup.model.parameter_values)
        fixed = {
            "x": np.array([s.x for s in states]),
            "theta": np.array([s.theta for s in states]),
            "covariance": np.array([s.covariance for s in states]),
            "noise": np.array([s.noise_std for s in states]),
            **parameters["fixed"],
        }
        by_row = {
            "t": record.times_before([s.time for s in states]),
            "u": record.inputs,
            "measured": measured,
            "present": present,
            **parameters["by_row"],
        }
        if self._recursive:
            fixed["S"] = np.array([s.sensitivity for s in states])
        corrections = [s.correction for s in states if s.correction is not None]
        if self._correction.outputs:
            fixed |= {
                "gain": np.array([c.gain for c in corrections]),
                "reach": np.array([c.reach for c in corrections]),
            }
            by_row["seen"], by_row["there"] = driving(record, self._correction.rows)
        return fixed, by_row

    def _by_samples(
        self, states: Sequence[RpemState], record: EnsembleRecord, judge: Information
    ) -> list[tuple[RpemState, Track]]:
        """One sample of all members at a time: what may move is judged between two samples."""
        fixed, by_row = self._arguments(states, record)
        information = np.array([s.information for s in states])
        carried = {"x": "x_next", "theta": "theta_next", "covariance": "covariance_next"}
        carried |= {"S": "S_next"} if self._recursive else {}
        wanted = [*RESULTS, *(["S_next"] if self._recursive else []), "information"]
        kept: dict[str, list[FloatArray]] = {name: [] for name in RESULTS}
        said: list[list[Status]] = []
        for k in range(len(record.time)):
            fixed["free"], starved = judge.free_directions_of(information)
            now = {name: value[:, k : k + 1] for name, value in by_row.items()}
            found = self._lanes(len(record), 1, fixed, now, last=wanted)
            fine = np.isfinite(found["flags"][:, 0])
            for name, result in carried.items():
                found[result] = np.where(fine.reshape(-1, *(1,) * (found[result].ndim - 1)), found[result], fixed[name])
                fixed[name] = found[result]
            gained = judge.add(information, found["information"], self._setup.dt)
            information = np.where(fine[:, None, None], gained, information)
            said.append(_statuses(fine, found["flags"], starved))
            for name in RESULTS:
                kept[name].append(found[name])
        rows = {name: np.stack(values, axis=1) for name, values in kept.items()}
        tracked = []
        for m, state in enumerate(states):
            track = _track(record.time, {name: rows[name][m] for name in RESULTS}, tuple(row[m] for row in said))
            last = np.array(fixed["S"][m]) if self._recursive else state.sensitivity
            tracked.append((_after(state, track, last, information[m].copy()), track))
        return tracked


def _statuses(fine: Flags, flags: FloatArray, starved: Flags) -> list[Status]:
    """Status of one sample of each member, as `Rpem.update` gives it."""
    said = []
    for ok, projected, some, low in zip(fine, flags[:, 1] > 0, flags[:, 2] > 0, starved, strict=True):
        usual = (Status.LOW_INFORMATION if low else Status.OK) if some else Status.MISSING
        said.append(Status.NOT_FINITE if not ok else Status.PROJECTED if projected else usual)
    return said


def _track(time: FloatArray, rows: dict[str, FloatArray], said: tuple[Status, ...]) -> Track:
    return Track(
        time,
        rows["prediction"],
        rows["expected_std"],
        rows["theta_next"],
        rows["covariance_next"],
        rows["x_next"],
        said,
    )


def _after(state: RpemState, track: Track, sensitivity: FloatArray, information: FloatArray) -> RpemState:
    return replace(
        state,
        time=float(track.time[-1]),
        x=track.state[-1].copy(),
        theta=track.parameters[-1].copy(),
        covariance=track.covariance[-1].copy(),
        sensitivity=sensitivity,
        information=information,
    )
