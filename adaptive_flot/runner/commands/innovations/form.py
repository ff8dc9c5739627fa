"""A fitted model in innovations form: which noise predicts best, and what becomes of a record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from adaptive_flot.contracts.batch import ParameterEstimate
from adaptive_flot.discovery.innovations.filter.refit import NU, Refit, Refitter
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.filtering import Filtered, NoiseModel, RecordFilter, prediction_errors, smooth
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.stepper import Stepper

HORIZONS = (1, 10, 100)
"""Rows ahead, at most, of the predictions whose errors are told."""
NEAR = HORIZONS[:2]
"""Those that choose between kinds of noise: further ahead, what has been followed up to now says little."""
WALKS = (1e-3, 3e-3, 1e-2, 2e-2, 4e-2, 8e-2, 0.16)
"""Sizes of a walk that are tried, in scales of a parameter per square root of a row."""
NO_WORSE = 1.05
"""Ratio of mean errors of predictions up to which one is no worse: of parameters that walk over those that stay, and of
parameters fitted in innovations form over those of the free run."""
SHARES = (1.0, 0.1, 0.01)
"""Shares of the process noise that are tried with each."""


@dataclass(frozen=True)
class HorizonError:
    """Root mean square error of an output on the test block, predicted up to so many rows ahead."""

    output: str
    unit: str
    rows: int
    seconds: float
    error: float


def best_form(
    model: Model, record: Dataset, columns: Sequence[int], floor: FloatArray, names: Sequence[str], p: FloatArray
) -> tuple[InnovationsForm, Refitter]:
    """Fit from parameters (np,) with heavy tails and with none; the fit whose predictions are best.

    Heavy tails take an outlier for what it is. A model that is wrong for a while loses its track by them. What predicts
    best one row ahead may be far off a hundred rows ahead, where the model is wrong. Then the parameters stay where
    they were.
    """
    kinds = [Refitter(model, record, columns, floor, names, degrees_of_freedom=nu) for nu in (NU, float("inf"))]

    def best(fits: Sequence[Refit]) -> tuple[InnovationsForm, Refitter]:
        covariances = [refitter.covariance(found) for refitter, found in zip(kinds, fits, strict=True)]
        forms = [
            InnovationsForm(model, record.dt, tuple(columns), tuple(names), found, covariance)
            for found, covariance in zip(fits, covariances, strict=True)
        ]
        return min(zip(forms, kinds, strict=True), key=lambda each: each[0].mean_error(record))

    fitted, stays = best([k.fit(p) for k in kinds]), best([k.at(p) for k in kinds])
    errors = [form.mean_error(record, horizons=HORIZONS) for form, _ in (fitted, stays)]
    return fitted if errors[0] <= NO_WORSE * errors[1] else stays


@dataclass(frozen=True)
class InnovationsForm:
    """A fitted model in innovations form, and what is made of it."""

    model: Model
    dt: float
    columns: tuple[int, ...]
    names: tuple[str, ...]
    found: Refit
    covariance: FloatArray

    def start(self, record: Dataset, noise: NoiseModel) -> tuple[FloatArray, FloatArray]:
        """Means and covariance before the first row; walking parameters start about where the fit has them."""
        refitter = Refitter(self.model, record, self.columns, np.ones(len(self.columns)), ())
        z, P = refitter.start(replace(noise, walk={}), self.found.p)
        if not noise.walk:
            return z, P
        where, n = list(self.model.indices("parameters", self.names)), len(z)
        joint = np.zeros((n + len(where),) * 2)
        duration = len(record) * self.dt  # the mean of a walk is off its start by a third of what it walks, in variance
        joint[:n, :n] = P
        joint[n:, n:] = self.covariance + np.diag([w**2 * duration / 3 for w in noise.walk.values()])
        return np.concatenate([z, self.found.p[where]]), joint

    def run(self, record: Dataset, noise: NoiseModel) -> Filtered:
        """Filter a record."""
        run = RecordFilter(self.model, self.dt, self.columns, tuple(noise.walk), noise.degrees_of_freedom)
        return run.run(record, noise, *self.start(record, noise), self.found.p)

    def best_noise(self, fit: Dataset, refitter: Refitter) -> NoiseModel:
        """The noise of the fit, or with parameters that walk, where that is likelier and predicts no worse."""
        walking = self._walking(fit, refitter, self.found.size, self.found.noise)
        return walking if self.mean_error(fit, walking) <= NO_WORSE * self.mean_error(fit) else self.found.noise

    def _walking(
        self, fit: Dataset, refitter: Refitter, size: tuple[float, float], still: NoiseModel
    ) -> NoiseModel:  # fmt: skip
        """The likeliest noise with parameters that walk; process noise is smaller beside."""
        scale = {q.name: q.scale or abs(q.value) or 1.0 for q in self.model.parameters}
        tried = [
            replace(
                refitter.noise((share * size[0], size[1])),
                walk={name: walk * scale[name] / np.sqrt(self.dt) for name in self.names},
                degrees_of_freedom=still.degrees_of_freedom,
            )
            for walk in WALKS
            for share in SHARES
        ]
        likely = [self._log_likelihood(fit, noise) for noise in tried]
        best = int(np.argmax(np.nan_to_num(likely, nan=-np.inf)))
        worth = likely[best] > self._log_likelihood(fit, still) + np.log(len(fit)) / 2
        return tried[best] if worth else still

    def _log_likelihood(self, record: Dataset, noise: NoiseModel) -> float:
        return float(self.run(record, noise).log_likelihood.sum())

    def mean_error(
        self, record: Dataset, noise: NoiseModel | None = None, horizons: Sequence[int] = NEAR
    ) -> float:  # fmt: skip
        """Mean absolute error over horizons and outputs, in mean changes of an output from row to row.

        With the noise of the fit, or another one.
        """
        noise = self.found.noise if noise is None else noise
        measured, filtered = record.outputs[:, list(self.columns)], self.run(record, noise)
        unit = np.maximum(np.nanmean(np.abs(np.diff(measured, axis=0)), axis=0), 1e-300)
        left = [np.abs(self._left(record, filtered, noise, rows))[1:] for rows in horizons]
        mean = float(np.mean([np.nanmean(e / unit) for e in left]))
        return mean if np.isfinite(mean) else float("inf")

    def _left(self, record: Dataset, filtered: Filtered, noise: NoiseModel, rows: int) -> FloatArray:
        """Measured less predicted, up to so many rows ahead (N, m)."""
        if rows == 1:
            return np.asarray(record.outputs[:, list(self.columns)] - filtered.predicted, dtype=np.float64)
        stepper = Stepper(self.model, self.dt)
        return prediction_errors(stepper, record, filtered, self.columns, tuple(noise.walk), self.found.p, rows)

    def estimates(self) -> tuple[ParameterEstimate, ...]:
        """Fitted parameters with their standard deviations."""
        std = np.sqrt(np.diag(self.covariance))
        chosen = [self.model.parameters[i] for i in self.model.indices("parameters", self.names)]
        values = self.found.p[list(self.model.indices("parameters", self.names))]
        return tuple(
            ParameterEstimate(q.name, q.label, q.unit, float(v), float(s), bool(v <= q.lower or v >= q.upper))
            for q, v, s in zip(chosen, values, std, strict=True)
        )

    def errors(
        self, record: Dataset, first: int, filtered: Filtered, noise: NoiseModel, rows: int
    ) -> tuple[HorizonError, ...]:
        """Errors on the rows from `first` on, up to so many rows ahead."""
        left = self._left(record, filtered, noise, rows)
        outputs = [self.model.outputs[c] for c in self.columns]
        rms = np.sqrt(np.nanmean(left[max(first, 1) :] ** 2, axis=0))
        return tuple(
            HorizonError(q.name, q.unit, rows, rows * self.dt, float(e)) for q, e in zip(outputs, rms, strict=True)
        )

    def table(self, record: Dataset, first: int, filtered: Filtered) -> pd.DataFrame:
        """What a record becomes: smoothed states and parameters, and outputs predicted one row ahead."""
        smoothed = smooth(filtered)
        std, nx = smoothed.std(), len(self.model.states)
        block = np.where(np.arange(len(record)) < first, "fit", "test")
        found: dict[str, object] = {"time_s": record.time, "block": block}
        for j, state in enumerate(self.model.states):
            found |= {state.column: smoothed.z[:, j], f"{state.column}_std": std[:, j]}
        walks = smoothed.z.shape[1] > nx
        for j, e in enumerate(self.estimates()):
            values = smoothed.z[:, nx + j] if walks else np.full(len(record), e.value)
            spread = std[:, nx + j] if walks else np.full(len(record), e.std)
            found |= {f"{e.label}_smoothed": values, f"{e.label}_smoothed_std": spread}
        for j, c in enumerate(self.columns):
            column, predicted, spread = self.model.outputs[c].column, filtered.predicted[:, j], filtered.variance[:, j]
            later = np.arange(len(record)) > 0  # nothing was known before the first row
            found |= {
                f"{column}_predicted": np.where(later, predicted, np.nan),
                f"{column}_predicted_std": np.where(later, np.sqrt(spread), np.nan),
            }
        return pd.DataFrame(found)
