"""Parameters and noise of a model in innovations form, by maximum likelihood."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.filtering.filter import Filtered, RecordFilter
from adaptive_flot.greybox.filtering.noise_model import NoiseModel
from adaptive_flot.greybox.model import FloatArray, Model

LEAST = 1e-7
"""Smallest noise, as a share of the scale: what is smaller is none."""
WIDEST = 1e3
STEP = 1e-4
"""Step of the differences, in units of the scaled unknowns."""
TOLERANCE = 1e-7
INITIAL = 1.0
"""Standard deviation of the initial state before the first row, in the scales of the states."""
PRIOR = 20.0
"""Standard deviation of the weak prior of a parameter, in its scales."""


@dataclass(frozen=True)
class InnovationsFit:
    """A model in innovations form, fitted.

    Attributes
    ----------
    parameters
        Full parameter vector (np,).
    free
        Names of the free parameters (q,).
    noise
        Process and measurement noise.
    log_likelihood
        Of all rows that counted, without the prior.
    filtered
        What the filter makes of each record.
    start
        z0 and P0 of each record.
    evaluations
        Runs of the filter over all records.
    """

    parameters: FloatArray
    free: tuple[str, ...]
    noise: NoiseModel
    log_likelihood: float
    filtered: tuple[Filtered, ...]
    start: tuple[tuple[FloatArray, FloatArray], ...]
    evaluations: int


@dataclass(frozen=True)
class Unknown:
    """One scaled unknown of the search, noise by its logarithm: its kind and name, its scale and its bounds."""

    kind: str
    name: str
    scale: float
    lower: float
    upper: float


def maximise(
    model: Model,
    records: Sequence[Dataset],
    start: NoiseModel,
    *,
    free: Sequence[str] = (),
    parameters: FloatArray | None = None,
    initial: Sequence[tuple[FloatArray, FloatArray]] | None = None,
    rows: Sequence[FloatArray] | None = None,
    estimate_process: bool = True,
    estimate_measurement: bool = True,
    estimate_walk: bool = True,
    most: int = 60,
) -> InnovationsFit:
    """Maximise the log-likelihood of the innovations over parameters and noise.

    ``log L = sum_k log t_nu(y_k - y_k|k-1; S_k)``. Kristensen, Madsen & Jorgensen (2004), equation 12, with Student's t
    in the place of the Gaussian. Noise is searched for in its logarithm, parameters in their scales with a wide prior.

    Parameters
    ----------
    model
        The model.
    records
        Stretches of measured rows, each without a gap and with an initial state of its own.
    start
        Noise to start from; only what it names is estimated, and what walks is what its `walk` names.
    free
        Names of free parameters.
    parameters
        Parameters to start from (np,); default those of the model.
    initial
        z0 (n,) and P0 (n, n) of each record; default the model's initial guess or record's own state, with one scale.
    rows
        Rows that count, a mask (N,) a record; default all.
    estimate_process, estimate_measurement, estimate_walk
        Which noise is free.
    most
        Most iterations of the search (L-BFGS-B, scipy).

    Raises
    ------
    ModelError
        No record, or no measured output.
    """
    if not records:
        raise ModelError("an innovations fit needs a record; give at least one")
    measured = sorted({model.index("outputs", name) for record in records for name in record.measured(model)})
    filters = {
        dt: RecordFilter(model, dt, measured, tuple(start.walk), start.degrees_of_freedom)
        for dt in dict.fromkeys(record.dt for record in records)
    }
    p0 = model.parameter_values if parameters is None else parameters.copy()
    starts = tuple(initial) if initial is not None else tuple(first_state(model, r, start, p0) for r in records)
    unknowns = _unknowns(model, start, free, measured, estimate_process, estimate_measurement, estimate_walk)
    z0 = np.array([_scaled(u, start, model, p0) for u in unknowns])
    count = 0

    def run(z: FloatArray) -> tuple[FloatArray, NoiseModel, tuple[Filtered, ...]]:
        p, noise = _unscaled(unknowns, z, start, model, p0)
        found = tuple(
            filters[r.dt].run(r, noise, *_walking_from(model, noise, s, p), p)
            for r, s in zip(records, starts, strict=True)
        )
        return p, noise, found

    def value(found: Sequence[Filtered]) -> float:
        total = 0.0
        for k, f in enumerate(found):
            each = f.log_likelihood if rows is None else f.log_likelihood[rows[k].astype(bool)]
            total += float(each.sum())
        return total

    def cost(z: FloatArray) -> float:
        nonlocal count
        count += 1
        with np.errstate(all="ignore"):
            total = value(run(z)[2])
        prior = sum(
            ((x - x0) / PRIOR) ** 2 / 2 for u, x, x0 in zip(unknowns, z, z0, strict=True) if u.kind == "parameter"
        )
        return -total + prior if np.isfinite(total) else 1e12

    if unknowns:
        bounds = [(u.lower, u.upper) for u in unknowns]
        options: Any = {"maxiter": most, "ftol": TOLERANCE, "eps": STEP}
        low, high = np.array(bounds).T
        first: FloatArray = np.clip(z0, low, high)
        z = minimize(cost, first, method="L-BFGS-B", bounds=bounds, options=options).x
    else:
        z = z0
    p, noise, found = run(z)
    return InnovationsFit(p, tuple(free), noise, value(found), found, starts, count)


def first_state(model: Model, record: Dataset, noise: NoiseModel, p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """z0 and P0 before the first row: the record's own state or the model's first guess, known to one scale."""
    scale = np.array([s.scale for s in model.states])
    guess = model.first_guess
    x = guess
    if record.initial_state is not None:  # states of an effect that came later start from their guess
        x = np.concatenate([record.initial_state, guess[len(record.initial_state) :]])
    walking = p[model.indices("parameters", noise.walk)]
    P = np.zeros((len(x) + len(walking),) * 2)
    P[: len(x), : len(x)] = np.diag((INITIAL * scale) ** 2)
    return np.concatenate([x, walking]), P


def _walking_from(
    model: Model, noise: NoiseModel, start: tuple[FloatArray, FloatArray], p: FloatArray
) -> tuple[FloatArray, FloatArray]:
    z, P = start
    if not noise.walk:
        return z, P
    z = z.copy()
    z[len(model.states) :] = p[model.indices("parameters", noise.walk)]
    return z, P


def _unknowns(
    model: Model,
    start: NoiseModel,
    free: Sequence[str],
    measured: Sequence[int],
    process: bool,
    measurement: bool,
    walk: bool,
) -> list[Unknown]:
    low, high = np.log(LEAST), np.log(WIDEST)
    found = []
    for name in free:
        q = model.parameters[model.index("parameters", name)]
        scale = q.scale or abs(q.value) or 1.0
        found.append(Unknown("parameter", q.name, scale, q.lower / scale, q.upper / scale))
    states = {s.name: s.scale for s in model.states}
    if process:
        found += [Unknown("process", n, states[n], low, high) for n in start.process]
    if measurement:
        outputs = [model.outputs[j] for j in measured]
        found += [Unknown("measurement", o.name, o.scale, low, high) for o in outputs]
    if walk:
        for name in start.walk:
            q = model.parameters[model.index("parameters", name)]
            found.append(Unknown("walk", q.name, q.scale or 1.0, low, high))
    return found


def _scaled(u: Unknown, noise: NoiseModel, model: Model, p: FloatArray) -> float:
    if u.kind == "parameter":
        return float(p[model.index("parameters", u.name)] / u.scale)
    table: Mapping[str, float] = getattr(noise, u.kind)
    return float(np.log(max(table.get(u.name, 0.0) / u.scale, LEAST)))


def _unscaled(
    unknowns: Sequence[Unknown], z: FloatArray, start: NoiseModel, model: Model, p0: FloatArray
) -> tuple[FloatArray, NoiseModel]:
    p = p0.copy()
    tables: dict[str, Any] = {kind: dict(getattr(start, kind)) for kind in ("process", "measurement", "walk")}
    for u, x in zip(unknowns, z, strict=True):
        if u.kind == "parameter":
            p[model.index("parameters", u.name)] = x * u.scale
        else:
            tables[u.kind][u.name] = float(np.exp(x) * u.scale) if x > np.log(LEAST) + 1e-9 else 0.0
    return p, replace(start, **tables)
