"""Several tests as one: the step-down procedure of Holm.

That of statsmodels gives the same answers, but collects garbage of the whole process in every call: 60 ms, which a loop
that tests every window can not spare.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TypeVar

import numpy as np

Test = TypeVar("Test", bound=Hashable)


def holm(p_values: Mapping[Test, float], level: float) -> dict[Test, bool]:
    """Which of m tests reject, so that any wrong rejection among them has at most the probability `level`.

    The i-th smallest p value rejects when p_(i) <= level / (m + 1 - i), and all smaller ones do: Holm, *Scand. J.
    Statist.* 6 (1979) 65.

    Parameters
    ----------
    p_values
        P value by test; one that could not be made (NaN) does not reject.
    level
        Level of all tests together.
    """
    usable = {test: p if np.isfinite(p) else 1.0 for test, p in p_values.items()}
    rejects = dict.fromkeys(p_values, False)
    for left, test in zip(range(len(usable), 0, -1), sorted(usable, key=usable.__getitem__), strict=True):
        if usable[test] > level / left:
            break
        rejects[test] = True
    return rejects
