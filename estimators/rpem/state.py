"""State of the recursion, handed from sample to sample."""

from __future__ import annotations

from dataclasses import dataclass

from adaptive_flot.greybox.model import FloatArray
from estimators.shared.state_correction import Correction


@dataclass(frozen=True)
class RpemState:
    """What the next step needs.

    Attributes
    ----------
    time
        Time of the model state [s].
    x
        Model state (nx,), predicted with the newest estimate.
    theta
        Estimate (q,).
    covariance
        sigma^2 L (q, q): the paper's inverse Hessian L times the noise variance.
    noise_std
        sigma of each output (m,).
    sensitivity
        dx/dtheta (nx, q), for the recursive gradient.
    information
        Sum of psi psi' / sigma^2 over the last while (q, q), where directions may be frozen.
    correction
        Gain of the state correction; None until the first sample, whose operating point it is designed for.
    """

    time: float
    x: FloatArray
    theta: FloatArray
    covariance: FloatArray
    noise_std: FloatArray
    sensitivity: FloatArray
    information: FloatArray
    correction: Correction | None
