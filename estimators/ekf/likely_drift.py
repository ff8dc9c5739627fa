"""Process noise of a joint filter by maximum likelihood: how fast parameters drift, as far as a record tells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, minimize_scalar
from scipy.stats import chi2

from adaptive_flot.contracts import Prior, Sample, Setup
from adaptive_flot.errors import DataError
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from estimators.ekf.estimator import Ekf
from estimators.shared.joint_filter import filter_step
from estimators.shared.measured import driving_outputs

SLOWEST, FASTEST = 1e-3, 10.0
"""Range of the drift that is searched, as a share of a parameter an hour."""


@dataclass(frozen=True)
class DriftFit:
    """Most likely drift, as a share an hour, and the largest that the record does not reject at 95 %."""

    drift_per_hour: float
    upper: float
    log_likelihood: float


def log_likelihood(setup: Setup, prior: Prior, samples: Sequence[Sample], drift_per_hour: float) -> float:
    """Logarithm of the likelihood of a record: that of the innovations of the joint filter with this drift."""
    estimator = Ekf(setup, drift_per_hour=drift_per_hour, outlier_std=np.inf)
    step = FastCall(filter_step(setup, estimator.layout), matrices=("P", "Q", "P_next"))
    state, total = estimator.init(prior), 0.0
    z, P, time = state.z, state.P, prior.time
    for sample in samples:
        _, driving, present = driving_outputs(sample, estimator.columns, len(setup.model.outputs))
        p = setup.model.parameter_values if sample.parameters is None else sample.parameters
        z, P, _, _, gained, _ = step(z, P, estimator.noise, time, sample.inputs, p, prior.noise_std, driving, present)
        total, time = total + float(gained[0]), sample.time
    return total


def most_likely_drift(setup: Setup, prior: Prior, samples: Sequence[Sample]) -> DriftFit:
    """Drift of all adapted parameters, as one share, that makes a record most likely.

    A record in which nothing drifts gives the slowest drift that is searched (0.001): it says nothing about what comes
    later, and `upper` is what it leaves possible, from the likelihood ratio.

    Parameters
    ----------
    setup
        Model, sampling interval, adapted parameters and driving outputs.
    prior
        Where the filter starts, with its noise.
    samples
        The record.

    Raises
    ------
    DataError
        The record has no likelihood: the filter does not get through it.

    Source: Schweppe, IEEE Trans. Information Theory 11 (1965).
    """

    def minus(log_drift: float) -> float:
        return -log_likelihood(setup, prior, samples, float(np.exp(log_drift)))

    low, high = float(np.log(SLOWEST)), float(np.log(FASTEST))
    # not always with one peak: the best of a coarse grid, then the peak beside it
    grid = np.linspace(low, high, 9)
    values = np.array([minus(x) for x in grid])
    if not np.isfinite(values).any():
        raise DataError("the drift has no likelihood: the model does not get through the record; check its start")
    best = int(np.nanargmin(values))
    bracket = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    minimum = minimize_scalar(minus, bounds=bracket, method="bounded", options={"xatol": 0.02})
    peak, value = (
        (float(minimum.x), float(minimum.fun)) if minimum.fun <= values[best] else (float(grid[best]), values[best])
    )
    allowed = float(value) + float(chi2.ppf(0.95, 1)) / 2
    upper = high
    if minus(high) > allowed:
        upper = float(brentq(lambda x: minus(x) - allowed, peak, high, xtol=0.02))
    return DriftFit(float(np.exp(peak)), float(np.exp(upper)), -float(value))
