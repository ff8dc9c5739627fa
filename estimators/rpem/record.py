"""RPEM over a block of samples in one call: the update as a recursion without Python between the samples."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from adaptive_flot.contracts import Setup, Status
from adaptive_flot.contracts.track import Track
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.recursion import Recursion
from estimators.rpem.state import RpemState
from estimators.rpem.update import UpdateOptions, update_function

BLOCK_ROWS = 200
"""Samples a call takes."""


class RecordBlock:
    """Takes `BLOCK_ROWS` samples at once; for an update that is one function from state to state.

    Parameters
    ----------
    setup, options
        As of the update.
    """

    def __init__(self, setup: Setup, options: UpdateOptions) -> None:
        self._setup, self._options = setup, options
        self._columns = setup.model.indices("outputs", setup.outputs)
        self._p = setup.model.parameter_values

    @cached_property
    def _recursion(self) -> Recursion:
        # made when first asked for: a run sample by sample has no use for it, and compiling it takes seconds
        carried = {"x": "x_next", "theta": "theta_next", "covariance": "covariance_next"}
        if self._options.gradient == "recursive":
            carried["S"] = "S_next"
        function = update_function(self._setup, self._options)
        return Recursion(function, carried, BLOCK_ROWS, as_machine_code=self._setup.model.compiled)

    def __call__(
        self, state: RpemState, time: FloatArray, inputs: FloatArray, outputs: FloatArray
    ) -> tuple[RpemState, Track] | None:
        """Estimates at the samples, and the state after them; None where a sample is to be skipped (NOT_FINITE).

        Parameters
        ----------
        state
            Before the first sample.
        time, inputs, outputs
            Of each sample, (BLOCK_ROWS,), (BLOCK_ROWS, nu) and (BLOCK_ROWS, ny).
        """
        measured = outputs[:, self._columns]
        present = np.isfinite(measured)
        carried = {"x": state.x, "theta": state.theta, "covariance": state.covariance, "S": state.sensitivity}
        each = {
            "t": np.concatenate([[state.time], time[:-1]])[:, None],
            "u": inputs,
            "p": self._p,
            "noise": state.noise_std,
            "measured": np.where(present, measured, 0.0),
            "present": present.astype(float),
        }
        rows = self._recursion(carried, each)
        flags = rows["flags"]
        if not np.isfinite(flags[:, 0]).all():
            return None
        track = Track(
            time,
            rows["prediction"],
            rows["expected_std"],
            rows["theta_next"],
            rows["covariance_next"],
            rows["x_next"],
            tuple(Status.PROJECTED if f[1] > 0 else Status.OK if f[2] > 0 else Status.MISSING for f in flags.tolist()),
        )
        last = replace(
            state, time=float(time[-1]), x=track.state[-1], theta=track.parameters[-1], covariance=track.covariance[-1]
        )
        return (replace(last, sensitivity=rows["S_next"][-1]) if "S_next" in rows else last), track
