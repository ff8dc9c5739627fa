"""A dead time is told from a lag by the innovations form; its place is not told from others in a row."""

import numpy as np
import pytest

from adaptive_flot.discovery.innovations.in_words import told_in_words
from adaptive_flot.discovery.innovations.judge import judge
from adaptive_flot.discovery.innovations.search.beam import best_explanations
from adaptive_flot.discovery.innovations.search.search import Search
from tests.discovery.innovations.late_tank import DT, model, record

DEAD_ROWS = 8


@pytest.mark.parametrize("wander", [0.0, 0.004, 0.02])
def test_a_late_gauge_is_told_as_a_dead_time_of_the_gauge_or_the_pump(wander: float) -> None:
    """What wanders in the tank is as likely before a dead time as behind it: the pump is no name."""
    search = Search(model(), record(3, 600, wander, DEAD_ROWS), (0,), np.array([0.01]), ("time",))
    base = search.base(model().parameter_values)
    found = best_explanations(search, base)
    told = judge(search, base, found)
    assert told.word == "class" and not told.certain, told.why
    assert {h.site for _, h in told.open} == {"pump", "gauge"} and {h.driver for _, h in told.open} == {"delay"}
    late = [search.model_of(e).parameters[-1].value for e, _ in told.open]
    assert late == pytest.approx([DEAD_ROWS * DT] * 2, rel=0.15)
    assert told_in_words(search, told).count("with a dead time of") == 2
    lags = [e.criterion for e in found if [h.driver for h in e.hypotheses] == ["lag"]]
    assert all(told.best.criterion > criterion + 30.0 for criterion in lags), "a lag explains clearly less"


def test_a_lag_is_not_told_as_a_dead_time() -> None:
    search = Search(model(), record(3, 600, 0.004), (0,), np.array([0.01]), ("time",))
    base = search.base(model().parameter_values)
    told = judge(search, base, best_explanations(search, base))
    assert {h.driver for h in told.effects} == {"lag"}, told.why
