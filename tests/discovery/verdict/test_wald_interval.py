"""Intervals of what is told: inside the range of a coefficient, and as large as a fraction where it is a time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.discovery.verdict.conclude import wald
from adaptive_flot.greybox.forms.catalogue import FORMS

LAG = next(c for c in FORMS["lag"].coefficients({"scale": 1.0}) if c.name == "time_constant")
BAND = next(c for c in FORMS["stiction"].coefficients({"scale": 1.0, "follow_s": 1.0}) if c.name == "band")
SHIFT = FORMS["shift"].coefficients({})[0]


def test_a_well_known_time_has_the_usual_interval() -> None:
    low, high = wald(LAG, 120.0, 1.0)
    assert (low, high) == pytest.approx((120 - 1.96, 120 + 1.96), abs=0.02)


@given(value=st.floats(1e-3, 1e6), share=st.floats(0.0, 1e4))
def test_a_time_is_above_zero_however_badly_it_is_known(value: float, share: float) -> None:
    low, high = wald(LAG, value, share * value)
    assert 0 < low <= value <= high and np.isfinite(high)
    assert low * high == pytest.approx(value**2) or low == LAG.lower, "a factor up and down"


@given(value=st.floats(0.0, 1e3), std=st.floats(0.0, 1e6))
def test_a_band_is_not_below_nothing_and_an_offset_may_be(value: float, std: float) -> None:
    assert wald(BAND, value, std)[0] >= 0
    assert wald(SHIFT, value, std) == pytest.approx((value - 1.96 * std, value + 1.96 * std))
