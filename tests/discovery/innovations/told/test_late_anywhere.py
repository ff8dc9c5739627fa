"""Lags in a row commute: what a late actuator does, a late sensor does as well, where nothing wanders in between."""

import numpy as np
import pytest

from adaptive_flot.discovery.innovations.judge import judge
from adaptive_flot.discovery.innovations.search.beam import best_explanations
from adaptive_flot.discovery.innovations.search.search import Search
from tests.discovery.innovations.late_tank import LATE, model, record


@pytest.mark.parametrize("seed", [0, 1])
def test_a_late_gauge_is_told_together_with_a_late_pump(seed: int) -> None:
    search = Search(model(), record(seed, 300, 0.0), (0,), np.array([0.01]), ("time",))
    base = search.base(model().parameter_values)
    told = judge(search, base, best_explanations(search, base))
    assert told.word == "class", told.why
    assert {h.site for _, h in told.open} == {"pump", "gauge"} and not told.certain
    first, second = (e.criterion for e, _ in told.open)
    assert first == pytest.approx(second, abs=5.0), "as likely, but for how the first rows start"
    late = [search.model_of(e).parameters[-1].value for e, _ in told.open]
    assert late == pytest.approx([LATE] * 2, rel=0.15)
