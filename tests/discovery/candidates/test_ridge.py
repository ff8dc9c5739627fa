"""Ridge regression: with ordinary noise, and without any."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.discovery.candidates.ridge import ridge


@pytest.mark.parametrize("size", [1.0, 1e9])
def test_coefficients_that_look_alike_share_what_they_explain(size: float) -> None:
    """Responses of 10^9 units of noise are those of an output without noise: there X'X + I is singular in rounding."""
    common = np.sin(np.arange(300.0))[:, None]
    found = ridge(size * np.repeat(common, 3, axis=1), size * common[:, 0])
    squares = size**2 * float(np.sum(common**2))
    assert found == pytest.approx(squares / (3 * squares + 1), rel=1e-6)
