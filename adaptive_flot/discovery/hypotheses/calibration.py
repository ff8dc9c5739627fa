"""What the reference records say: constants and their uncertainty, usual errors, ranges of sites and drivers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from adaptive_flot.discovery.hypotheses.cross_validation import Fitted, stretches, test_on_stretches
from adaptive_flot.discovery.hypotheses.joint.fit import JointFit, JointFitter
from adaptive_flot.discovery.hypotheses.joint.known_before import (
    Constants,
    first_states,
    loose_constants,
    scattered_starts,
)
from adaptive_flot.discovery.hypotheses.joint.rows import Rows, noise_floor, rows_of, spread
from adaptive_flot.discovery.hypotheses.joint.usual_errors import UsualErrors, overall_sizes, usual_errors
from adaptive_flot.discovery.hypotheses.seen import seen_values
from adaptive_flot.discovery.record.effective_samples import correlation_times
from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model

ROUNDS = 2
"""How often the usual sizes are taken from a fit and the fit is made again."""
FIRST_SIZE = 0.1
"""First guess of the size of the errors, as a share of the spread of an output."""


@dataclass(frozen=True)
class Calibration:
    """A model fitted to records on which it is taken to be right.

    Attributes
    ----------
    model
        The model with the constants.
    fit
        Its fit.
    rows
        Records and rows it was fitted to, with the usual sizes of the errors.
    usual
        Usual errors by where the plant is.
    losses, square_memory
        Criterion of each row and output (N, m), a record, as for a new record, see `_as_new`, and rows that count as
        one for a mean of them; none where there is no reference.
    constants
        What the records say of the constants.
    noise
        Noise of each output from row to row (m,), see `noise_floor`.
    seen, drivers
        Values at each site and of each driver, of all records behind one another.
    """

    model: Model
    fit: JointFit
    rows: Rows
    usual: UsualErrors
    losses: tuple[FloatArray, ...]
    square_memory: float
    constants: Constants
    noise: FloatArray
    seen: Mapping[str, FloatArray]
    drivers: Mapping[str, FloatArray]

    def sizes(self, record: Dataset) -> FloatArray:
        """Usual size of each output's error in every row of a new record (N, m).

        A sensor that is noisier from row to row than on the reference says nothing of the process. With v the variance
        of that noise, on the new record and on the reference::

            size^2 = usual^2 + max(v_new - v_reference, 0)
        """
        more = np.maximum(noise_floor([record], self.rows.columns) ** 2 - self.noise**2, 0.0)
        return np.asarray(np.sqrt(self.usual.sizes(record) ** 2 + more))


def calibrate(
    model: Model,
    records: Sequence[Dataset],
    free: Sequence[str],
    columns: Sequence[int],
    others: Sequence[Dataset] = (),
    *,
    local: bool = True,
) -> Calibration:
    """Fit constants to records: robust, from several starts, with the sizes of the errors taken from the fit.

    Parameters
    ----------
    model
        The model.
    records
        The records.
    free
        Names of the constants that are fitted.
    columns
        Indices of the outputs that count (m,).
    others
        Records that will be asked about.
    local
        Whether usual errors differ by where the plant is; else one size an output.

    Raises
    ------
    DataError
        The model can not simulate the records.
    """
    floor = noise_floor(records, columns)
    first = np.maximum(floor, FIRST_SIZE * spread(records, columns))
    rows = rows_of(records, columns, [np.tile(first, (len(r), 1)) for r in records])
    loose = loose_constants(model, free)
    fits = [_fit_from(model, rows, loose, start) for start in scattered_starts(model, loose)]
    best = min(fits, key=lambda f: f.cost)
    if not all(np.isfinite(e[c]).any() for e, c in zip(best.errors, rows.counted, strict=True)):
        names = ", ".join(record.name for record in records)
        raise DataError(f"{names}: the model '{model.name}' can not simulate it; check units and first guesses")
    for _ in range(ROUNDS):
        overall = overall_sizes(rows, best.errors, floor)
        rows = rows.with_sizes([np.tile(overall, (len(r), 1)) for r in records])
        best = JointFitter(model, rows, loose).fit(best.unknowns)
    usual = usual_errors(rows, best.errors, floor, others)
    if local:
        rows = rows.with_sizes([usual.sizes(r) for r in records])
        best = JointFitter(model, rows, loose).fit(best.unknowns)
        usual = usual_errors(rows, best.errors, floor, others)
        rows = rows.with_sizes([usual.sizes(r) for r in records])
    rows = rows.with_sizes(rows.sizes, memory_of(rows, best.errors))
    fitted = model.with_parameters(best.values)
    seen, drivers = seen_values(fitted, best, records)
    losses, memory = _as_new(model, rows, loose, best, floor, others) if local else ((), 1.0)
    return Calibration(fitted, best, rows, usual, losses, memory, _told(loose, best, rows), floor, seen, drivers)


def _as_new(
    model: Model, rows: Rows, loose: Constants, fit: JointFit, floor: FloatArray, others: Sequence[Dataset]
) -> tuple[tuple[FloatArray, ...], float]:
    """Criterion of each row by constants and usual sizes that did not see its stretch.

    A new record fits neither. A row that is its own neighbour, in a fit to itself, costs less than the same row would
    on another day. With it, the rows that count as one for a mean of squares.
    """
    whole = Fitted(None, loose, first_states(model, rows.records), fit)
    fresh = test_on_stretches(model, rows, whole, hold_constants=False).fresh
    sizes = [size.copy() for size in rows.sizes]
    for left_out in stretches(rows):
        elsewhere = usual_errors(rows.without(left_out), fit.errors, floor, others)
        for size, record, mask in zip(sizes, rows.records, left_out, strict=True):
            size[mask] = elsewhere.sizes(record)[mask]
    again = rows.with_sizes(sizes, rows.memory)
    return again.losses(fresh), max(memory_of_squares(again.scaled(i, e)) for i, e in enumerate(fresh))


def _fit_from(model: Model, rows: Rows, loose: Constants, start: FloatArray) -> JointFit:
    fitter = JointFitter(model, rows, loose)
    z = fitter.unknowns.start()
    z[: len(start)] = start
    return fitter.fit(z)


def _told(loose: Constants, fit: JointFit, rows: Rows) -> Constants:
    """Constants and covariance after a fit: the inverse of the curvature of the criterion, with its priors.

    ::

        covariance = (J^T J / tau + I)^-1

    A direction of which no row speaks stays as loose as it was.
    """
    c, count = len(loose.names), len(fit.unknowns)
    data = fit.jacobian[: len(fit.jacobian) - count]
    memory = np.tile(np.broadcast_to(rows.memory, len(rows.columns)), len(data) // len(rows.columns))
    covariance = np.linalg.inv((data.T / memory) @ data + np.eye(count))[:c, :c]
    values, vectors = np.linalg.eigh(covariance)
    mean = loose.mean + loose.root @ fit.unknowns[:c]
    return Constants(loose.names, mean, loose.root @ (vectors * np.sqrt(np.maximum(values, 0.0))))


def memory_of(rows: Rows, errors: Sequence[FloatArray]) -> FloatArray:
    """Rows that count as one, of each output (m,): the integrated autocorrelation time of its scaled errors.

    The longest one stands for all: a model that is wrong for hours in one output is not right by chance in another.
    """
    times = [correlation_times(np.clip(rows.scaled(i, e), -3.0, 3.0)) for i, e in enumerate(errors)]
    return np.full(len(rows.columns), float(np.nanmax(np.array(times), initial=1.0)))


def memory_of_squares(scaled: FloatArray) -> float:
    """Rows that count as one for a mean of squares of errors (N, m): the longest of the outputs.

    With the autocorrelations rho of the errors about zero, up to the lag K before the first that is not positive::

        1 + 2 sum_(k=1..K) rho_k^2

    Bartlett, *J. R. Statist. Soc. Suppl.* 8 (1946) 27: the variance of a mean of squares of a normal series.
    """
    times = []
    for e in np.clip(scaled, -3.0, 3.0).T:
        spectrum = np.fft.rfft(e, 2 * len(e))
        products = np.fft.irfft(spectrum * spectrum.conj())[: max(len(e) // 2, 1)]
        rho = products / products[0] if products[0] > 0 else np.zeros(1)
        below = np.flatnonzero(~(rho > 0))
        times.append(1 + 2 * float(np.sum(rho[1 : below[0] if below.size else len(rho)] ** 2)))
    return max(times)
