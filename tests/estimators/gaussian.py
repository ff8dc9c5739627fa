"""A model that is linear in states and parameters together, and its exact posterior by least squares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup
from adaptive_flot.greybox.model import FloatArray, Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.stepping.stepper import Stepper


def linear_plant() -> Model:
    """Two coupled states driven by th0 u0 and th1 u1; measured: the second state, the first with th1 on top."""

    def equations(s: Scope) -> None:
        a, b = s.state("a"), s.state("b")
        s.derivative("a", -0.3 * a + s.parameter("th0") * s.input("u0"))
        s.derivative("b", 0.4 * a - 0.2 * b + s.parameter("th1") * s.input("u1"))
        s.output("b", b)
        s.output("sum", a + s.parameter("th1"))

    return Model(
        name="linear-plant",
        states=(Quantity("a", "-", ""), Quantity("b", "-", "", scale=2.0)),
        inputs=(Quantity("u0", "-", ""), Quantity("u1", "-", "")),
        parameters=(Parameter("th0", 1.0, "-", "", role="estimated"), Parameter("th1", 0.5, "-", "", role="estimated")),
        outputs=(Quantity("b", "-", ""), Quantity("sum", "-", "")),
        equations=equations,
    )


@dataclass(frozen=True)
class LinearRecord:
    """A record of the plant with missing measurements, and the prior."""

    setup: Setup
    prior: Prior
    samples: tuple[Sample, ...]


def linear_record(seed: int, rows: int = 25) -> LinearRecord:
    """Random inputs; `b` measured always but in a gap, `sum` every third sample only."""
    generator = np.random.default_rng(seed)
    model = linear_plant()
    setup = Setup(model, 1.0, ("th0", "th1"), ("b", "sum"))
    half = generator.normal(size=(4, 4))
    joint = half @ half.T + 0.5 * np.eye(4)
    inputs = generator.normal(size=(rows, 2))
    outputs = generator.normal(size=(rows, 2))
    outputs[np.arange(rows) % 3 != 0, 1] = np.nan
    outputs[7:10] = np.nan
    prior = Prior(0.0, generator.normal(size=2), generator.normal(size=2), joint[2:, 2:], np.array([0.3, 0.7]), joint)
    samples = tuple(Sample(k + 1.0, u, y) for k, (u, y) in enumerate(zip(inputs, outputs, strict=True)))
    return LinearRecord(setup, prior, samples)


def affine_maps(record: LinearRecord, *, integrated: bool = False) -> tuple[list[FloatArray], list[FloatArray]]:
    """z -> F z + f over each interval and z -> H z + h, as matrices with the constant in the last column.

    z = (a, b, th0, th1) or with the two rates behind it; found by trying unit vectors, without any derivative.
    """
    setup = record.setup
    call = Stepper(setup.model, setup.dt).call
    n = 6 if integrated else 4

    def carry(z: FloatArray, sample: Sample) -> FloatArray:
        theta = z[2:4] + (setup.dt * z[4:] if integrated else 0.0)
        x, y, _ = call(z[:2], sample.time - setup.dt, sample.inputs, theta)
        return np.concatenate([x, theta, z[4:], y])

    steps, measurements = [], []
    for sample in record.samples:
        constant = carry(np.zeros(n), sample)
        columns = np.column_stack([carry(unit, sample) - constant for unit in np.eye(n)])
        both = np.column_stack([columns, constant])
        steps.append(both[:n])
        measurements.append(both[n:])
    return steps, measurements


def posterior(record: LinearRecord, Q: FloatArray, *, integrated: bool = False) -> tuple[FloatArray, FloatArray]:
    """Exact means (N + 1, n) and covariances (N + 1, n, n) of z at every instant, given the whole record.

    Unknowns: z at the start, and the noise w of each interval where it has variance; one least-squares problem.
    """
    steps, measurements = affine_maps(record, integrated=integrated)
    n, rows = len(Q), len(record.samples)
    moving = np.flatnonzero(np.diag(Q) > 0)
    spread = np.zeros((n, n))
    spread[:4, :4] = record.prior.joint_covariance
    free = np.flatnonzero(np.diag(spread) > 0)
    count = free.size + rows * moving.size
    P = np.zeros((count, count))
    P[: free.size, : free.size] = spread[np.ix_(free, free)]
    for k in range(rows):
        part = slice(free.size + k * moving.size, free.size + (k + 1) * moving.size)
        P[part, part] = Q[np.ix_(moving, moving)]
    # z_k as an affine function of the unknowns
    to_z = np.zeros((n, count + 1))
    to_z[free, np.arange(free.size)] = 1.0
    to_z[:4, -1] = np.concatenate([record.prior.state, record.prior.parameters])
    maps, regressors, right, noise = [to_z], [], [], []
    for k, sample in enumerate(record.samples):
        started = maps[-1].copy()
        started[moving, free.size + k * moving.size + np.arange(moving.size)] += 1.0
        for j in np.flatnonzero(np.isfinite(sample.outputs)):
            row = measurements[k][j, :-1] @ started
            regressors.append(row[:-1])
            right.append(sample.outputs[j] - row[-1] - measurements[k][j, -1])
            noise.append(record.prior.noise_std[j])
        carried = steps[k][:, :-1] @ started
        carried[:, -1] += steps[k][:, -1]
        maps.append(carried)
    A, b, r = np.array(regressors), np.array(right), np.array(noise)
    covariance = np.linalg.inv(np.linalg.inv(P) + A.T @ np.diag(r**-2) @ A)
    mean = covariance @ A.T @ (b / r**2)
    means = np.array([m[:, :-1] @ mean + m[:, -1] for m in maps])
    return means, np.array([m[:, :-1] @ covariance @ m[:, :-1].T for m in maps])


def first_rows(record: LinearRecord, count: int) -> LinearRecord:
    """The record up to a sample."""
    return LinearRecord(record.setup, record.prior, record.samples[:count])


def run_estimator(estimator: object, record: LinearRecord) -> list[Estimate]:
    """Estimates of every sample."""
    state, estimates = estimator.init(record.prior), []  # type: ignore[attr-defined]
    for sample in record.samples:
        state, estimate = estimator.update(state, sample)  # type: ignore[attr-defined]
        estimates.append(estimate)
    return estimates
