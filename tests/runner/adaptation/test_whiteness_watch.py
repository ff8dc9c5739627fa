"""The watch on innovations: white ones alarm as rarely as stated, others at once."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.runner.adaptation.whiteness_watch import watch

WINDOW, WINDOWS, LEVEL = 200, 400, 0.05


@pytest.mark.parametrize("size", [1.0, 1e-7])
def test_white_innovations_alarm_in_the_stated_share_of_windows(size: float) -> None:
    """Two outputs, four tests together, 400 windows: within the 0.1 and 99.9 % points of the binomial law, whatever
    the unit; and not so rarely that nothing would ever alarm."""
    noise = size * np.random.default_rng(1).standard_normal((WINDOWS, 2, WINDOW))
    alarms = sum(watch({"a": a, "b": b}, LEVEL) is not None for a, b in noise)
    law = binom(WINDOWS, LEVEL)
    assert law.ppf(0.001) <= alarms <= law.ppf(0.999)


def coloured(white: FloatArray) -> FloatArray:
    values = white.copy()
    for k in range(1, len(values)):
        values[k] += 0.5 * values[k - 1]
    return values


@pytest.mark.parametrize("missing", [0.0, 0.4])
def test_a_shift_and_a_correlation_alarm_and_are_named(missing: float) -> None:
    generator = np.random.default_rng(2)
    white = generator.standard_normal((2, WINDOW))
    gaps = np.where(generator.random(WINDOW) < missing, np.nan, 0.0)
    calm = white[1] - np.mean(white[1])
    shifted = watch({"grade": white[0] + 0.6 + gaps, "level": calm}, 1e-3)
    assert shifted is not None and set(shifted.p_values) == {"grade mean"}
    late = watch({"grade": coloured(white[0]) + 0 * gaps, "level": calm}, 1e-3)
    assert late is not None and "grade correlation" in late.p_values and "level mean" not in late.p_values
    assert watch({"level": calm}, 1e-3) is None


@pytest.mark.parametrize("values", [np.full(WINDOW, np.nan), np.zeros(WINDOW), np.full(WINDOW, 3.0), np.arange(49.0)])
def test_what_holds_no_innovations_is_not_tested(values: FloatArray) -> None:
    """Nothing measured, a replayed constant, fewer than 50: no verdict, no warning and no error."""
    assert watch({"grade": values}, 0.4) is None
