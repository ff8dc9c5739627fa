"""Whether a record tells one explanation from another: by enough, and in more than a few rows."""

from __future__ import annotations

import numpy as np
from scipy.stats import bootstrap

from adaptive_flot.discovery.innovations.search.explanation import LEAST_GAIN, Explanation, worth
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.greybox.model import FloatArray

NEAR = 0.05
"""Where process noise outweighs the measurement noise, something else is wrong with the model. An explanation whose
gain is smaller by less than this share of it is then not told apart."""
ADEQUATE = 1.5
"""Standard deviation of an innovation, in those of the measurement noise, up to which nothing else is wrong."""
BLOCK = 12
"""Rows of a block of the bootstrap: innovations hardly remember."""
DRAWS = 999


def told_apart(search: Search, base: Explanation, best: Explanation, other: Explanation) -> bool:
    """Whether the record tells an explanation from a better one: by enough, and in more than a few rows."""
    lead, least = worth(best) - worth(other), LEAST_GAIN / 2
    if not _adequate(search, best):
        least = max(least, NEAR * (best.criterion - base.criterion))
    effects = len(best.hypotheses) - len(other.hypotheses)
    return lead >= least and low_end(best.fit.rows - other.fit.rows, best.numbers - other.numbers, effects) > 0


def _adequate(search: Search, explanation: Explanation) -> bool:
    """Whether measurement noise is about all that an explanation leaves."""
    fit = explanation.fit
    r = fit.noise.std(search.model)[list(search.columns)]
    return float(np.max(np.nanmedian(np.sqrt(fit.filtered.variance), axis=0) / r)) <= ADEQUATE


def block_sums(gain: FloatArray) -> FloatArray:
    """Sums of values (N,) over blocks of BLOCK rows, four at least (k,)."""
    return np.array([b.sum() for b in np.array_split(gain, max(len(gain) // BLOCK, 4))])


def low_end(gain: FloatArray, numbers: int = 0, effects: int = 0) -> float:
    """Lower end of the 95 % interval of a sum over rows (N,) by the block bootstrap.

    Less k / 2 log n for k numbers, and LEAST_GAIN for each effect.
    """
    counted = gain[gain != 0]
    blocks = block_sums(gain)
    charge = (numbers / 2 * float(np.log(max(len(counted), 2))) + LEAST_GAIN * effects) / len(blocks)
    if not blocks.std() > 0:
        return float((blocks - charge).sum())
    found = bootstrap((blocks - charge,), np.sum, n_resamples=DRAWS, method="percentile", rng=0, vectorized=True)
    return float(found.confidence_interval.low)
