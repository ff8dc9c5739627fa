"""The extended Kalman filter over a whole record."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.filtering import linearised
from adaptive_flot.greybox.filtering.noise_model import STUDENT, NoiseModel
from adaptive_flot.greybox.filtering.step import filter_after_steps, filter_step, first_correction
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.compiling.compiled import CompileError
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.greybox.stepping.in_steps import interval_by_interval, steps_along
from adaptive_flot.greybox.stepping.recursion import RowByRow
from adaptive_flot.greybox.stepping.whole_record.tape_recursion import TapeRecursion

CARRIED, HELD = {"z": "z_next", "P": "P_next"}, ("p", "Q", "r")
"""Arguments of the step that its results replace from row to row, and those that are the same in all rows."""
LEAST_MEMBERS = 3
"""Cases that are worth running side by side: one or two take as long as all places of a register."""


@dataclass(frozen=True)
class Filtered:
    """What the filter makes of one stretch of N rows, for m outputs and n = nx + w entries of z.

    Attributes
    ----------
    predicted, variance
        Outputs predicted from the row before, and the variance of the innovation (N, m).
    log_likelihood
        Log-density of each row (N,).
    z, P
        States and walking parameters at each row, corrected by it (N, n), with covariance (N, n, n).
    ahead, F
        Where row k leads before row k + 1 is used (N - 1, n), and the derivative of that map (N - 1, n, n).
    H
        Derivative of the outputs predicted for row k + 1 by the state at row k (N - 1, m, n).
    Q
        Variance that process noise adds at the start of each interval (n,).
    """

    predicted: FloatArray
    variance: FloatArray
    log_likelihood: FloatArray
    z: FloatArray
    P: FloatArray
    ahead: FloatArray
    F: FloatArray
    H: FloatArray
    Q: FloatArray


class RecordFilter:
    """The filter of one model for records of one sampling interval.

    Parameters
    ----------
    model
        The model.
    dt
        Sampling interval [s].
    outputs
        Indices of the outputs that correct (m,).
    walking
        Names of parameters that walk (w,).
    degrees_of_freedom
        Of the innovations; infinity is the Gaussian filter.
    beside
        Names of further parameters by which derivatives of the same steps are asked for elsewhere: both are built from
        one function. The filter itself does not depend on them, but for rounding.
    """

    def __init__(
        self,
        model: Model,
        dt: float,
        outputs: Sequence[int],
        walking: Sequence[str] = (),
        degrees_of_freedom: float = STUDENT,
        beside: Sequence[str] = (),
    ) -> None:
        if not outputs:
            raise ModelError(f"model '{model.name}': a filter needs a measured output; name at least one")
        self.model, self.dt = model, dt
        self.outputs, self.walking = tuple(outputs), tuple(walking)
        self._degrees_of_freedom = degrees_of_freedom
        self._first, self._many = model.derived(
            _calls, dt, self.outputs, self.walking, degrees_of_freedom, tuple(beside), threading.get_ident()
        )

    def run(self, record: Dataset, noise: NoiseModel, z0: FloatArray, P0: FloatArray, p: FloatArray) -> Filtered:
        """Filter one record.

        Parameters
        ----------
        record
            N rows without a gap; a missing output is NaN.
        noise
            Process and measurement noise.
        z0, P0
            States and walking parameters before the first row (n,), and their covariance (n, n).
        p
            Parameters (np,); those that walk are taken from z.

        Raises
        ------
        ModelError
            Wrong shapes.
        """
        n, rows = len(self.model.states) + len(self.walking), len(record)
        (z, P, predicted, variance, likelihood), each, Q = self._from_first_row(_Seen(self, record), noise, z0, P0, p)
        if rows == 1:
            ahead, F, H = np.empty((0, n)), np.empty((0, n, n)), np.empty((0, len(self.outputs), n))
            return Filtered(predicted[None], variance[None], likelihood.ravel(), z[None], P[None], ahead, F, H, Q)
        joined = self._many({"z": z, "P": P}, each)
        F, H = (joined[of].reshape(rows - 1, n, -1).transpose(0, 2, 1) for of in ("F", "H"))  # they come by columns
        return Filtered(
            np.vstack([predicted[None], joined["predicted"]]),
            np.vstack([variance[None], joined["variance"]]),
            np.concatenate([likelihood.ravel(), joined["log_likelihood"].ravel()]),
            np.vstack([z[None], joined["z_next"]]),
            np.concatenate([P[None], joined["P_next"].reshape(-1, n, n)]),
            joined["ahead"],
            F,
            H,
            Q,
        )

    def log_likelihoods(
        self, record: Dataset, cases: Sequence[tuple[NoiseModel, FloatArray, FloatArray, FloatArray]]
    ) -> FloatArray:
        """Log-densities of the rows (cases, N) for several cases (noise, z0, P0, p), side by side: those of `run`."""
        if len(cases) >= LEAST_MEMBERS and len(record) > 1 and isinstance(self._many, TapeRecursion):
            with suppress(CompileError):  # without the library for several they are run one by one
                return self._side_by_side(self._many, record, cases)
        return np.array([self.run(record, *case).log_likelihood for case in cases]).reshape(-1, len(record))

    def log_likelihoods_near(
        self, run: Filtered, record: Dataset, cases: Sequence[tuple[NoiseModel, FloatArray, FloatArray, FloatArray]]
    ) -> FloatArray:
        """The same (cases, N) for other noise than that of a run at the same parameters, by the derivatives along it.

        Nothing is integrated, see `filtering.linearised`.
        """
        starts, noises, found, seen = [], [], np.empty((len(cases), len(record))), _Seen(self, record)
        for i, case in enumerate(cases):
            (z, P, _, _, likelihood), each, Q = self._from_first_row(seen, *case)
            starts.append((z - run.z[0], P))
            noises.append((Q, each["r"]))
            found[i, 0] = likelihood.item()
        if cases and len(record) > 1:
            y = record.outputs[1:, list(self.outputs)]
            there = np.isfinite(y)
            along = {
                "F": linearised.by_columns(run.F),
                "H": linearised.by_columns(run.H),
                "error": np.where(there, y - run.predicted[1:], 0.0),
                "shift": run.z[1:] - run.ahead,
                "there": there.astype(float),
            }
            found[:, 1:] = linearised.log_likelihoods(along, starts, noises, self._degrees_of_freedom)
        return found

    def _side_by_side(
        self,
        many: TapeRecursion,
        record: Dataset,
        cases: Sequence[tuple[NoiseModel, FloatArray, FloatArray, FloatArray]],
    ) -> FloatArray:
        members, found, seen = [], np.empty((len(cases), len(record))), _Seen(self, record)
        for i, case in enumerate(cases):
            (z, P, _, _, likelihood), each, _ = self._from_first_row(seen, *case)
            members.append({"z": z, "P": P, **each})
            found[i, 0] = likelihood.item()
        found[:, 1:] = many.side_by_side(members, "log_likelihood")[:, :, 0]
        return found

    def _from_first_row(
        self, seen: _Seen, noise: NoiseModel, z0: FloatArray, P0: FloatArray, p: FloatArray
    ) -> tuple[Sequence[FloatArray], dict[str, FloatArray], FloatArray]:
        """The correction by the first row, the arguments of all other rows, and the variance of process noise (n,)."""
        n = len(self.model.states) + len(self.walking)
        if z0.shape != (n,) or P0.shape != (n, n):
            raise ModelError(f"the filter takes z0 ({n},) and P0 ({n}, {n}); got {z0.shape} and {P0.shape}")
        r, Q = noise.std(self.model)[list(self.outputs)], noise.variances(self.model, self.dt)
        first = self._first(z0, P0, seen.begins, seen.inputs, p, r, seen.outputs, seen.there)
        return first, {**seen.each, "p": p, "Q": Q, "r": r}, Q


class _Seen:
    """A record as a filter takes it: what its first row shows, and the arguments of all others."""

    def __init__(self, to: RecordFilter, record: Dataset) -> None:
        y = record.outputs[:, list(to.outputs)]
        there = np.isfinite(y).astype(float)
        y = np.where(there > 0, y, 0.0)
        self.begins, self.inputs, self.outputs, self.there = float(record.time[0]), record.inputs[0], y[0], there[0]
        t = record.time[0] + to.dt * np.arange(len(record) - 1, dtype=float)
        self.each = {"t": t[:, None], "u": record.inputs[1:], "y": y[1:], "there": there[1:]}


def _calls(
    model: Model,
    dt: float,
    outputs: tuple[int, ...],
    walking: tuple[str, ...],
    degrees_of_freedom: float,
    beside: tuple[str, ...],
    thread: int,
) -> tuple[FastCall, RowByRow]:
    """The first correction, and the step from row to row, with their working memory: those of one thread.

    A search of the noise makes a filter for each size that it tries.
    """
    del thread
    first = first_correction(model, outputs, walking, degrees_of_freedom)
    many = interval_by_interval(
        None if walking else steps_along(model, dt, ()),
        lambda: filter_after_steps(model, dt, outputs, degrees_of_freedom),
        lambda: filter_step(model, dt, outputs, walking, degrees_of_freedom, beside),
        CARRIED,
        HELD,
    )
    return FastCall(first, ["P", "P_next"]), many
