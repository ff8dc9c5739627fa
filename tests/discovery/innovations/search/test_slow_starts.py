"""A late sensor hides in a store: the fit without it has a larger one, and from there the sensor stays too fast."""

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.innovations.search.beam import best_explanations
from adaptive_flot.discovery.innovations.search.search import Search
from benchmarks.other_processes.plants.heat_exchanger import make_model as model
from tests.discovery.innovations.exchanger import HOLDUP, LATE, UA, record

NAMES = ("ua", "holdup")


@pytest.mark.parametrize("seed", [0, 1])
def test_a_late_thermometer_is_found_from_the_constants_as_the_model_came(seed: int) -> None:
    data, plain = record("late", seed=seed), model()

    def best(given: tuple[float, ...]) -> tuple[float, np.ndarray]:
        floor = noise_floor([data], (0,))
        search = Search(plain, data, (0,), floor, NAMES, as_given=given, kinds=("lag",))
        with np.errstate(all="ignore"):
            found = best_explanations(search, search.base(np.array([UA, 2.5 * HOLDUP])))[0]
        assert "thermometer lag" in [h.label for h in found.hypotheses]
        return found.criterion, found.fit.p

    stuck, _ = best(())  # a second late part may help there
    gain, fitted = best(tuple(plain.parameter_values))
    found = fitted[[0, 1, -1]]
    assert len(fitted) == 4, "two constants and one lag: its share and its time"
    assert gain > stuck + 20, "explained better, and by one effect"
    assert found == pytest.approx([UA, HOLDUP, LATE], rel=0.12)
