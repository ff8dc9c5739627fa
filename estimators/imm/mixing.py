"""Interaction and combination of the filters of a multiple-model estimator, as compiled functions."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from adaptive_flot.greybox.model import FloatArray
from estimators.imm.modes import Mode
from estimators.shared.joint_filter import Layout


def mix_function(shape: Layout, modes: Sequence[Mode], transitions: FloatArray) -> ca.Function:
    """Where each filter starts the next interval: the mean over the modes that the process may come from.

    A mode that begins takes over states and parameters; its rate starts anew, from zero with the mode's entry
    covariance.

    Returns
    -------
    casadi.Function
        `(z (n, M), P (n, n M), probability (M,)) -> (z (n, M), P (n, n M), predicted probability (M,))`.
    """
    n, count, kept = shape.size, len(modes), shape.nx + shape.q
    z, P, probability = ca.SX.sym("z", n, count), ca.SX.sym("P", n, n * count), ca.SX.sym("probability", count)
    predicted = ca.SX(transitions.T) @ probability
    means, covariances = [], []
    for j, mode in enumerate(modes):
        # a mode that nothing leads to keeps finite weights
        weights = [transitions[i, j] * probability[i] / ca.fmax(predicted[j], 1e-300) for i in range(count)]
        starts, spreads = [], []
        for i in range(count):
            start, spread = z[:, i], P[:, i * n : (i + 1) * n]
            if i != j:
                start = ca.vertcat(start[:kept], ca.SX.zeros(n - kept))
                spread = ca.diagcat(spread[:kept, :kept], ca.SX.zeros(n - kept, n - kept)) + ca.SX(mode.entry)
            starts.append(start)
            spreads.append(spread)
        mean, covariance = _moments(weights, starts, spreads)
        means.append(mean)
        covariances.append(covariance)
    results = [ca.densify(ca.horzcat(*means)), ca.densify(ca.horzcat(*covariances)), predicted]
    names = ["z", "P", "probability"]
    return ca.Function("mix", [z, P, probability], results, names, ["z_mixed", "P_mixed", "predicted"])


def combine_function(shape: Layout, count: int) -> ca.Function:
    """Mean and covariance over all modes: `(z (n, M), P (n, n M), probability (M,)) -> (mean (n,), (n, n))`."""
    n = shape.size
    z, P, probability = ca.SX.sym("z", n, count), ca.SX.sym("P", n, n * count), ca.SX.sym("probability", count)
    spreads = [P[:, i * n : (i + 1) * n] for i in range(count)]
    moments = _moments([probability[i] for i in range(count)], [z[:, i] for i in range(count)], spreads)
    names = ["z", "P", "probability"], ["mean", "covariance"]
    return ca.Function("combine", [z, P, probability], [ca.densify(m) for m in moments], *names)


def _moments(weights: Sequence[ca.SX], means: Sequence[ca.SX], spreads: Sequence[ca.SX]) -> tuple[ca.SX, ca.SX]:
    """Mean and covariance of a mixture of Gaussians."""
    mean = sum((w * m for w, m in zip(weights, means, strict=True)), ca.SX(means[0].numel(), 1))
    covariance = ca.SX(mean.numel(), mean.numel())
    for w, m, spread in zip(weights, means, spreads, strict=True):
        covariance += w * (spread + (m - mean) @ (m - mean).T)
    return mean, (covariance + covariance.T) / 2
