"""Values along a run that can not be worked out at some rows are drawn between their neighbours."""

from __future__ import annotations

import numpy as np

from adaptive_flot.discovery.candidates.responses import _filled


def test_rows_without_a_value_are_drawn_between_their_neighbours() -> None:
    """Between nodes the states are drawn, and at a kink no algebraic variables may belong to them."""
    series = np.array([[0.0, np.nan, 2.0, 3.0], [np.nan, 5.0, 5.0, np.inf], [np.nan] * 4, [1.0, 2.0, 3.0, 4.0]])
    filled = _filled(series)
    np.testing.assert_array_equal(filled[:2], [[0.0, 1.0, 2.0, 3.0], [5.0, 5.0, 5.0, 5.0]])
    assert np.isnan(filled[2]).all()
    np.testing.assert_array_equal(filled[3], series[3])
