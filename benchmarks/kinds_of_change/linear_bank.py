"""A multiple-model filter on a linearised run, for many draws of noise and of the start at once.

The equations are those of `estimators/adaptive_imm/bank.py` without discrepancies and outliers, z = (x, c, v): states,
parameters and rates. Here they are written with NumPy, and apart from the estimator.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adaptive_flot.greybox.filtering.cramer_rao_bound import ParameterDrift
from adaptive_flot.greybox.model import FloatArray
from estimators.imm.modes import stationary


@dataclass(frozen=True)
class World:
    """N intervals of a linearised run with nx states and q parameters.

    Attributes
    ----------
    F, H
        Derivatives of the states (N, nx, nx + q) and of the output (N, nx + q) at the end of each interval.
    start
        Covariance of states and parameters before the first interval (nx + q, nx + q).
    c
        True parameters, one row before the first interval too (N + 1, q).
    noise
        Standard deviation of the output's noise.
    """

    F: FloatArray
    H: FloatArray
    start: FloatArray
    c: FloatArray
    noise: float


@dataclass(frozen=True)
class Motions:
    """M modes: variance that an interval adds to parameters and rates (M, 2 q), of rates that begin, transitions."""

    noise: FloatArray
    entry: FloatArray
    transitions: FloatArray


def track(world: World, motions: Motions, draws: int, seed: int, told: ParameterDrift | None = None) -> FloatArray:
    """Errors of the parameters (draws, N, q) after each interval.

    `told` says when rates are renewed, for a filter with one mode; default never.
    """
    rows, nx, size = world.F.shape
    q, modes, n = size - nx, len(motions.transitions), 2 * size - nx
    generator = np.random.default_rng(seed)
    values, axes = np.linalg.eigh(world.start)
    first = generator.standard_normal((draws, size)) * np.sqrt(np.maximum(values, 0.0)) @ axes.T
    noise = world.noise * generator.standard_normal((draws, rows))
    z, P = np.zeros((draws, modes, n)), np.zeros((draws, modes, n, n))
    z[..., :size] = first[:, None]
    z[..., nx:size] += world.c[0]
    P[..., :size, :size] = world.start
    c, v, d = slice(nx, size), slice(size, n), np.arange(n)
    P[..., d[v], d[v]] += motions.entry[:, q:]
    probability = np.tile(stationary(motions.transitions), (draws, 1))
    errors = np.empty((draws, rows, q))
    F = np.eye(n)
    for k in range(rows):
        z, P, expected = mixed(z, P, probability, motions, size)
        if told is not None:
            z[..., v] *= told.keep[k]
            P[..., v, :] *= told.keep[k][:, None]
            P[..., v] *= told.keep[k]
            P[..., d[v], d[v]] += told.variance[k]
        P[..., d[nx:], d[nx:]] += motions.noise
        z[..., c] += z[..., v]
        P[..., c, :] += P[..., v, :]
        P[..., c] += P[..., v]
        away = z.copy()
        away[..., c] -= world.c[k + 1]
        spread = P[..., :size] @ world.H[k]
        variance = spread[..., :size] @ world.H[k] + world.noise**2
        error = noise[:, k, None] - away[..., :size] @ world.H[k]
        away += (error / variance)[..., None] * spread
        P -= spread[..., :, None] * spread[..., None, :] / variance[..., None, None]
        log_likelihood = -(np.log(variance) + error**2 / variance) / 2
        weights = expected * np.exp(log_likelihood - log_likelihood.max(axis=1, keepdims=True))
        probability = weights / weights.sum(axis=1, keepdims=True)
        F[:nx, :size] = world.F[k]
        away = away @ F.T
        P = carried(P, F)
        errors[:, k] = np.einsum("rm,rmi->ri", probability, away[..., c])
        z = away
        z[..., c] += world.c[k + 1]
    return errors


def carried(P: FloatArray, F: FloatArray) -> FloatArray:
    """Covariances F P F' of symmetric P (..., n, n)."""
    half = (P.reshape(-1, len(F)) @ F.T).reshape(P.shape)
    found: FloatArray = (half.swapaxes(-1, -2).reshape(-1, len(F)) @ F.T).reshape(P.shape)
    return found


def mixed(
    z: FloatArray, P: FloatArray, probability: FloatArray, motions: Motions, size: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Means, covariances and predicted probabilities before the next interval; a rate begins anew with its mode."""
    draws, modes, n = z.shape
    if modes == 1:
        return z.copy(), P.copy(), probability
    expected = probability @ motions.transitions
    weights = motions.transitions * probability[:, :, None] / np.maximum(expected, 1e-300)[:, None, :]
    stays = np.einsum("rii->ri", weights)
    middle = np.einsum("rm,rmi->ri", probability, z)
    middle[:, size:] = 0.0
    away = z - middle[:, None]
    second = P + away[..., :, None] * away[..., None, :]
    to = weights.swapaxes(1, 2)
    mean = np.concatenate([to @ away[..., :size], stays[..., None] * away[..., size:]], axis=2)
    both = (to @ second.reshape(draws, modes, -1)).reshape(second.shape)
    same = stays[..., None, None] * second
    both[..., size:, :], both[..., size:] = same[..., size:, :], same[..., size:]
    both -= mean[..., :, None] * mean[..., None, :]
    rates = np.arange(size, n)
    both[..., rates, rates] += motions.entry[:, size - n :] * (1 - stays)[..., None]
    return middle[:, None] + mean, both, expected
