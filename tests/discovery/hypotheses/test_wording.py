"""Protects the sentence that compares a quantity at two places."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.hypotheses.wording import words_of
from adaptive_flot.greybox import Effect
from tests.discovery.hypotheses.tank import tank


@pytest.mark.parametrize(
    ("factor", "said"),
    [
        (2.5, "2.5 times as large at flow 4 as at 1"),
        (0.4, "0.4 times as large at flow 4 as at 1"),
        (1.2, "20 % larger at flow 4 than at 1"),
        (0.8, "20 % smaller at flow 4 than at 1"),
        (0.01, "next to nothing at flow 4, unlike at 1"),
    ],
)
def test_a_dependence_is_compared_as_one_would_say_it(factor: float, said: str) -> None:
    model = tank()
    site = next(s.name for s in model.sites if s.mode == "factor")
    effect = Effect(site, "flow", "curve", {}, {"knots": (1.0, 4.0)})
    found = Hypothesis(site, "flow", "depends", effect, ("value_1", "value_2"), ())
    value = dict(zip(found.parameters, (0.0, float(np.log(factor))), strict=True))
    assert words_of(model, found, value.__getitem__).endswith(f" depends on flow: {said}")
