"""What a batch estimator returns: estimates, covariance and what the record can not tell apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeGuard

import numpy as np

from adaptive_flot.contracts import Prior, Status
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray

WELL_IDENTIFIED = 0.1
"""Relative standard deviation up to which a parameter counts as identified."""
NOT_IDENTIFIED = 0.5
"""Relative standard deviation from which the record says nothing useful about a parameter."""
INSEPARABLE = 0.95
"""Correlation from which two estimates are reported as hard to tell apart."""


@dataclass(frozen=True)
class ParameterEstimate:
    """One fitted parameter: full name, label, unit, value and standard deviation in that unit, on a bound or not."""

    name: str
    label: str
    unit: str
    value: float
    std: float
    at_bound: bool


@dataclass(frozen=True)
class Identifiability:
    """What the record says about each parameter, and which pairs it can hardly separate.

    Attributes
    ----------
    parameters
        (label, relative standard deviation, "identified" | "weak" | "not identified" | "on a bound").
    pairs
        (label, label, correlation) of the pairs with `|correlation|` >= 0.95.
    verdict
        One sentence.
    """

    parameters: tuple[tuple[str, float, str], ...]
    pairs: tuple[tuple[str, str, float], ...]
    verdict: str

    @classmethod
    def judge(cls, labels: Sequence[str], covariance: FloatArray, at_bound: Sequence[bool]) -> Identifiability:
        """Judge a covariance (q, q) in units of each parameter's scale."""
        std = np.sqrt(np.diag(covariance))
        judged = tuple(
            (label, float(s), "on a bound" if bound else _word(float(s)))
            for label, s, bound in zip(labels, std, at_bound, strict=True)
        )
        correlation = covariance / np.outer(std, std)
        pairs = tuple(
            (labels[i], labels[j], float(correlation[i, j]))
            for i in range(len(labels))
            for j in range(i)
            if abs(correlation[i, j]) >= INSEPARABLE
        )
        return cls(judged, pairs, _sentence(judged, pairs))


def _word(relative_std: float) -> str:
    if relative_std <= WELL_IDENTIFIED:
        return "identified"
    return "weak" if relative_std < NOT_IDENTIFIED else "not identified"


def _sentence(judged: Sequence[tuple[str, float, str]], pairs: Sequence[tuple[str, str, float]]) -> str:
    parts = []
    for word, text in (
        ("not identified", "the record does not identify {}"),
        ("weak", "{} only to within {worst:.0%}"),
        ("on a bound", "{} ends on a bound: the model wants a value it may not have"),
    ):
        names = [label for label, _, w in judged if w == word]
        worst = max((s for _, s, w in judged if w == word), default=0.0)
        if names:
            parts.append(text.format(", ".join(names), worst=worst))
    for a, b, r in pairs:
        parts.append(f"{a} and {b} are hard to tell apart (correlation {r:+.3f})")
    return "; ".join(parts) if parts else "every fitted parameter is identified by this record"


@dataclass(frozen=True)
class BatchFit:
    """A batch fit.

    Attributes
    ----------
    record
        Name of the record.
    estimates
        The q fitted parameters.
    covariance
        Their covariance (q, q), each in its unit.
    noise_std
        Standard deviation of what the model leaves of each output (m,), corrected for the degrees of freedom.
    parameters
        Full parameter vector (np,).
    initial_state, last_state
        State at the first and at the last row (nx,).
    evaluations
        Simulations of the record with different unknowns.
    status
        What happened.
    identifiability
        What the record can not separate.
    joint_covariance
        Covariance of the last state and the fitted parameters together (nx + q, nx + q), where it is known.
    starts, agreed
        Searches of the whole record, each from another start, and how many of them ended at this fit.
    colour
        Long-run variance of what is left of each output (m,), over its variance, where it is known; see `Prior`.
    core_noise_std
        Standard deviation of what is left without the outliers (m,), where there are some.
    """

    record: str
    estimates: tuple[ParameterEstimate, ...]
    covariance: FloatArray
    noise_std: FloatArray
    parameters: FloatArray
    initial_state: FloatArray
    last_state: FloatArray
    evaluations: int
    status: Status
    identifiability: Identifiability
    joint_covariance: FloatArray | None = None
    starts: int = 1
    agreed: int = 1
    colour: FloatArray | None = None
    core_noise_std: FloatArray | None = None

    def values(self) -> FloatArray:
        """Fitted values (q,)."""
        return np.array([e.value for e in self.estimates])

    @property
    def agreement(self) -> str:
        """How many searches ended here, in words; empty where there was one."""
        if self.starts < 2:
            return ""
        rest = ", the others had a larger error" if self.agreed < self.starts else ""
        return f"{self.agreed} of {self.starts} searches from different starts ended at this fit{rest}"

    def prior(self, time: float) -> Prior:
        """Where a recursive estimator goes on from the last row of the record."""
        known = self.covariance, self.noise_std, self.joint_covariance, self.colour, self.core_noise_std
        return Prior(time, self.last_state, self.values(), *known)


class BatchEstimator(Protocol):
    """Fits a record at once. Made by `Name(setup, **options)`."""

    def fit(self, record: Dataset) -> BatchFit:
        """Fit a record."""
        ...


class FitsMany(BatchEstimator, Protocol):
    """A batch estimator that fits many records at once."""

    def fit_many(self, records: Sequence[Dataset]) -> list[BatchFit | Exception]:
        """What `fit` gives for each record, or what went wrong with one; it does not depend on the other records."""
        ...


def fits_many(estimator: BatchEstimator) -> TypeGuard[FitsMany]:
    """Whether `fit_many` is what `fit` gives: not where a derived class has its own `fit`."""
    first = {name: next((c for c in type(estimator).__mro__ if name in vars(c)), None) for name in ("fit", "fit_many")}
    return first["fit_many"] is not None and first["fit"] is first["fit_many"]
