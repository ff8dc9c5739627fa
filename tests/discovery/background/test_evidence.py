"""A background beside constants that stand out: the search for them ends where there are no more."""

from typing import Any

import numpy as np
import pytest

from adaptive_flot.discovery.background.evidence import Evidence, Spread


@pytest.mark.parametrize("count", [1, 2])
def test_every_constant_of_a_small_model_may_stand_out(count: int) -> None:
    """Each one with a wide prior brings more evidence, so that none is left to be tried."""
    evidence: Any = object.__new__(Evidence)
    evidence.count = count

    def with_constants(size: float, variances: Any, course: Any = None) -> Any:
        yield Spread(course, size, 100.0 * float(np.sum(variances > 0.5**2)))

    evidence._with_constants = with_constants
    found = evidence.but_for_what_stands_out(Spread(None, 0.05, 0.0))
    assert found.evidence == 100.0 * count
