"""A fitted alternative, and the criterion it was fitted by.

Output error (free run) with whitened innovations e, in standard deviations s of each output's noise, of which none
counts beyond c = CLIP::

    loss = sum over rows and outputs of min(e^2, c^2) + 2 log s

This is minus two log-likelihood of Gaussian noise up to a constant (Ljung, *System Identification*, 2nd ed., 7.4) with
truncated squares for outliers (Hinich & Talwar, *J. Am. Statist. Assoc.* 70 (1975) 113)::

    BIC = loss + q log(number of measurements)

with q free parameters: Schwarz, *Ann. Statist.* 6 (1978) 461.

Where there is a background (see `record.background`), the loss is that with its u integrated out, with the whitened
responses H to it (Laplace's method; exact but for the clipping)::

    loss + u'u + log det(I + H'H)

Rasmussen & Williams, *Gaussian Processes for Machine Learning* (2006), eq. (5.8). It costs no free parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from adaptive_flot.contracts import full_parameters
from adaptive_flot.discovery.record.noise import Noise
from adaptive_flot.discovery.record.problem import BoolArray, Problem
from adaptive_flot.greybox.model import FloatArray, Model


@dataclass(frozen=True)
class Fit:
    """A fitted alternative.

    Attributes
    ----------
    model
        The model with the fitted parameters.
    names
        Free parameters (q,), the adapted ones first.
    values, covariance
        Their values (q,) and covariance (q, q), each in its unit: the part of (J'J + P^-1)^-1 that is theirs, with the
        whitened derivatives J of the predictions and the prior covariance P of all unknowns.
    initial_state
        State at the first row (nx,).
    predicted
        Free run (N, m) of the measured outputs.
    innovations
        Whitened innovations (N, m) in standard deviations, NaN where missing.
    noise
        Noise model of the residual.
    loss
        Minus two log-likelihood on the rows fitted (up to a constant of the record).
    bic
        `loss` + free parameters x log(number of measurements).
    """

    model: Model
    names: tuple[str, ...]
    values: FloatArray
    covariance: FloatArray
    initial_state: FloatArray
    predicted: FloatArray
    innovations: FloatArray
    noise: Noise
    loss: float
    bic: float
    directions: FloatArray
    """Free combinations of the initial state (nx, r): those the record can tell; the rest keeps its first guess."""
    background: FloatArray
    """Components u (k,) of the background; empty without. What they do is part of `predicted`."""
    background_covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    """Their covariance (k, k): the part of (J'J + P^-1)^-1 that is theirs."""
    first_guess: FloatArray = field(default_factory=lambda: np.zeros(0))
    """Where the first row has the initial state (nx,), which is expected there; empty where a fit starts at rest."""

    def residual(self, problem: Problem) -> FloatArray:
        """Measured minus predicted (N, m)."""
        r: FloatArray = problem.measured - self.predicted
        return r

    def __getstate__(self) -> dict[str, object]:
        """A fit pickles without its model, whose equations do not pickle; `with_model` puts it back."""
        return {**self.__dict__, "model": None}

    def with_model(self, make: Callable[[], Model]) -> Fit:
        """The fit with the model that was fitted, made anew where it came without from another process."""
        if self.model is not None:
            return self
        return replace(self, model=make().with_parameters(dict(zip(self.names, map(float, self.values), strict=True))))

    def with_sizes(self, values: Mapping[str, float], covariance: FloatArray) -> Fit:
        """The fit with other values of some free parameters, and the covariance of these (k, k) in their order.

        They are taken as independent of the others, whose values and covariance stay.
        """
        where = [self.names.index(name) for name in values]
        z, P = self.values.copy(), self.covariance.copy()
        z[where] = list(values.values())
        P[where, :] = P[:, where] = 0.0
        P[np.ix_(where, where)] = covariance
        return replace(self, model=self.model.with_parameters(dict(values)), values=z, covariance=P)

    def std(self) -> FloatArray:
        """Standard deviation of each free parameter (q,)."""
        return np.sqrt(np.diag(self.covariance))


def loss_of(
    problem: Problem, predicted: FloatArray, rows: BoolArray, noise: Noise | None = None
) -> tuple[float, Noise]:
    """Minus two log-likelihood on some rows (see above); with the noise model given, or fitted to these rows."""
    weighted = (problem.measured - predicted) / problem.weights
    noise = noise or problem.noise(weighted, rows)
    e = noise.whiten(weighted)[rows]
    present = np.isfinite(e)
    squares = np.minimum(np.abs(np.where(present, e, 0)), problem.clip) ** 2
    return float(np.sum(squares) + 2 * np.sum(np.log(noise.std) * present.sum(axis=0))), noise


def row_losses(problem: Problem, fit: Fit, rows: BoolArray) -> FloatArray:
    """What each of some rows adds to minus two log-likelihood (rows,), with the noise of the fit."""
    e = fit.noise.whiten((problem.measured - fit.predicted) / problem.weights)[rows]
    present = np.isfinite(e)
    squares = np.minimum(np.abs(np.where(present, e, 0)), problem.clip) ** 2
    losses: FloatArray = np.sum(squares + 2 * np.log(fit.noise.std) * present, axis=1)
    return losses


def parameters_of(fit: Fit) -> FloatArray:
    """Full parameter vector (np,) of a fit."""
    return full_parameters(fit.model, fit.names, fit.values)
