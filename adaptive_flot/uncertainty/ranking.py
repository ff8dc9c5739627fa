"""Share of each constant in the variance of an output: Sobol' indices, by SALib."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from adaptive_flot.greybox.model import FloatArray

RESAMPLES = 200


@dataclass(frozen=True)
class Share:
    """What one constant does to the variance of an output.

    Attributes
    ----------
    label
        The constant.
    total
        Share of the variance that would go if it were known and all else were not: with what it does together with
        others (total-effect index).
    alone
        Share that it makes by itself (first-order index).
    total_half, alone_half
        Half widths of their 95 % confidence intervals.
    """

    label: str
    total: float
    alone: float
    total_half: float
    alone_half: float


def shares_of(labels: Sequence[str], values: FloatArray, seed: int) -> tuple[Share, ...]:
    """Shares of the constants, the largest total first; none where nothing varies or too little is left.

    Sobol', Math. Comput. Simul. 55 (2001); estimators of Saltelli et al., Comput. Phys. Commun. 181 (2010), with
    confidence intervals by resampling.

    Parameters
    ----------
    labels
        The d constants.
    values
        Results (n (d + 2),) in the order of the draws. A block with a result that is NaN is left out.
    seed
        Of the resampling.
    """
    from SALib.analyze import sobol  # takes seconds to import

    d = len(labels)
    blocks = values.reshape(-1, d + 2)
    blocks = blocks[np.isfinite(blocks).all(axis=1)]
    if len(blocks) < 2 or np.ptp(blocks) <= 1e-12 * np.abs(blocks).max():
        return ()
    problem = {"num_vars": d, "names": list(labels), "bounds": [[0.0, 1.0]] * d}
    found = sobol.analyze(problem, blocks.ravel(), calc_second_order=False, num_resamples=RESAMPLES, seed=seed)
    columns = (found[key] for key in ("ST", "S1", "ST_conf", "S1_conf"))
    shares = (Share(label, *map(float, row)) for label, *row in zip(labels, *columns, strict=True))
    return tuple(sorted(shares, key=lambda s: -s.total))
