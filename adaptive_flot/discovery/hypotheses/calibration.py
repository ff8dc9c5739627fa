"""What the reference records say: constants and their uncertainty, usual errors, ranges of sites and drivers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from adaptive_flot.discovery.hypotheses.joint.fit import JointFit, JointFitter
from adaptive_flot.discovery.hypotheses.joint.known_before import Constants, loose_constants, scattered_starts
from adaptive_flot.discovery.hypotheses.joint.rows import Rows, noise_floor, rows_of, spread
from adaptive_flot.discovery.hypotheses.joint.usual_errors import UsualErrors, overall_sizes, usual_errors
from adaptive_flot.discovery.hypotheses.seen import seen_values
from adaptive_flot.discovery.record.effective_samples import correlation_times
from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model

ROUNDS = 2
"""How often the usual sizes are taken from a fit and the fit is made again."""
RATIO = 0.5
"""Largest standard deviation, as a share of its value, of a constant that is known by its ratio."""
FACTOR = 3.0
"""Largest standard deviation of the logarithm of that ratio."""
EXCLUDED = 20.0
"""Drop of minus two log-likelihood of the reference beyond what its covariance charges, from which that misleads."""
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
    constants: Constants
    noise: FloatArray
    seen: Mapping[str, FloatArray]
    drivers: Mapping[str, FloatArray]


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
    best = JointFitter(model, rows, loose).fit_from_afar(best.unknowns)
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
    return Calibration(fitted, best, rows, usual, _told(model, loose, best, rows), floor, seen, drivers)


def _fit_from(model: Model, rows: Rows, loose: Constants, start: FloatArray) -> JointFit:
    fitter = JointFitter(model, rows, loose)
    z = fitter.unknowns.start()
    z[: len(start)] = start
    return fitter.fit(z)


def _told(model: Model, loose: Constants, fit: JointFit, rows: Rows) -> Constants:
    """Constants and covariance after a fit: the inverse of the curvature of the criterion, with its priors.

    ::

        covariance = (J^T J / tau + I)^-1

    Known by its ratio is a constant that is positive, may not be negative or has no bound, and would be uncertain by
    less than half (RATIO) were all others known.
    The logarithm of the ratio has a standard deviation of at most FACTOR: records that tell constants up to a common
    factor tell nothing of it, and a fit would drift along it to where a constant has its bound. A direction of which
    no row speaks else stays as loose as it was.
    """
    c, count = len(loose.names), len(fit.unknowns)
    data = fit.jacobian[: len(fit.jacobian) - count]
    memory = np.tile(np.broadcast_to(rows.memory, len(rows.columns)), len(data) // len(rows.columns))
    information = (data.T / memory) @ data + np.eye(count)
    mean, unit = loose.at(fit.unknowns[:c]), np.diag(loose.root)
    lower = np.array([model.parameters[i].lower for i in model.indices("parameters", loose.names)])
    by_ratio = ((lower >= 0) | np.isinf(lower)) & (unit / np.sqrt(np.diag(information)[:c]) < RATIO * mean)
    information[range(c), range(c)] += np.where(by_ratio, unit / (FACTOR * np.where(by_ratio, mean, 1.0)), 0.0) ** 2
    values, vectors = np.linalg.eigh(np.linalg.inv(information)[:c, :c])
    root = loose.root @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    return Constants(loose.names, mean, root, frozenset(n for n, r in zip(loose.names, by_ratio, strict=True) if r))


def excluded_by(calibration: Calibration, fit: JointFit) -> bool:
    """Whether the records of a calibration exclude the constants of another fit, though what is told of them does not.

    What is told is a covariance, in constants or in their logarithms. Where records tell a difference of two constants
    over a third, neither holds far away. So the records are asked themselves: their criterion with these constants,
    initial states fitted anew, less that of the calibration, is about the squared distance u'u that the covariance
    charges. It is more by EXCLUDED where the covariance misleads.
    """
    names = calibration.constants.names
    if not names:
        return False
    held = calibration.model.with_parameters({name: fit.value(name) for name in names})
    nothing = Constants((), np.empty(0), np.empty((0, 0)))
    fitter = JointFitter(held, calibration.rows, nothing, (), calibration.fit.initial)
    with np.errstate(all="ignore"):
        there = fitter.fit(fitter.unknowns.start())
    lost = criterion(calibration.rows, there) - criterion(calibration.rows, calibration.fit)
    first = len(fit.coefficients)
    charged = float(np.sum(fit.unknowns[first : first + len(names)] ** 2))
    return not lost <= charged + EXCLUDED  # a run that fails excludes them as well


def criterion(rows: Rows, fit: JointFit) -> float:
    """Criterion of a fit to some rows, without its priors."""
    return float(sum(loss.sum() for loss in rows.losses(fit.errors)))


def memory_of(rows: Rows, errors: Sequence[FloatArray]) -> FloatArray:
    """Rows that count as one, of each output (m,): the integrated autocorrelation time of its scaled errors.

    The longest one stands for all: a model that is wrong for hours in one output is not right by chance in another.
    """
    times = [correlation_times(np.clip(rows.scaled(i, e), -3.0, 3.0)) for i, e in enumerate(errors)]
    return np.full(len(rows.columns), float(np.nanmax(np.array(times), initial=1.0)))
