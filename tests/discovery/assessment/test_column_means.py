"""Means of columns with missing values: those of pandas, and nothing is said of a column without any."""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from adaptive_flot.discovery.assessment.reduction import column_means


@given(arrays(float, st.tuples(st.integers(0, 9), st.integers(1, 4)), elements=st.floats(-1e6, 1e6) | st.just(np.nan)))
def test_they_are_those_of_pandas_and_zero_of_an_empty_column(values: np.ndarray) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = column_means(values)
    np.testing.assert_allclose(found, pd.DataFrame(values).mean().fillna(0.0).to_numpy(), rtol=1e-9, atol=1e-6)
