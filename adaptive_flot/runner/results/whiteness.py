"""The test of innovations for whiteness.

That of statsmodels gives the same p values, but takes nine times as long, and a second or two to load: a page of many
runs makes hundreds of tests.
"""

from __future__ import annotations

import numpy as np
from scipy.special import chdtrc

from adaptive_flot.greybox.model import FloatArray

WHITENESS_LAGS = 20


def ljung_box_p(innovation: FloatArray, lags: int = WHITENESS_LAGS) -> float:
    """Return the p value of the test of Ljung and Box, Biometrika 65 (1978), of innovations (N,).

    With the autocorrelation r_k at lag k and n finite samples::

        Q = n (n + 2) sum_k r_k^2 / (n - k),  k = 1 ... lags

    follows a chi-square law with `lags` degrees of freedom where the innovations are white. Missing samples are left
    out, which is exact for the white series that the test supposes. NaN: a constant series, or one of 2 `lags` samples
    or fewer.
    """
    finite = innovation[np.isfinite(innovation)]
    if len(finite) <= 2 * lags or np.ptp(finite) == 0:
        return float("nan")
    n, moved = len(finite), finite - finite.mean()
    r = np.array([moved[k:] @ moved[:-k] for k in range(1, lags + 1)]) / (moved @ moved)
    Q = n * (n + 2) * np.sum(r**2 / (n - np.arange(1, lags + 1)))
    return float(chdtrc(lags, Q))
