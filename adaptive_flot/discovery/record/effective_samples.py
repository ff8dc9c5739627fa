"""How many rows of a correlated series count as one sample."""

from __future__ import annotations

import numpy as np
from statsmodels.tsa.stattools import acf

from adaptive_flot.greybox.model import FloatArray


def correlation_times(series: FloatArray) -> FloatArray:
    """Rows for each effective sample in each column (m,) of a series (N, m): its integrated autocorrelation time.

    With the autocorrelations rho, up to the lag K before the first that is not positive::

        t = 1 + 2 sum_(k=1..K) rho_k,   effective sample size = N / t

    Sokal, *Monte Carlo methods in statistical mechanics* (1997), eq. (2.16); the cut as by Geyer, *Statist. Sci.* 7
    (1992) 473.
    """
    times = []
    for r in series.T:
        rho = acf(r, nlags=len(r) // 4, fft=True, missing="conservative")[1:]
        below = np.flatnonzero(~(rho > 0))
        times.append(max(1.0, 1 + 2 * float(np.sum(rho[: below[0] if below.size else len(rho)]))))
    return np.array(times)
