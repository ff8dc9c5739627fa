"""A late sensor hides in a store: the fit without it has a larger one, and from there the sensor stays too fast."""

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.innovations.search import Search
from tests.discovery.innovations.exchanger import HOLDUP, LATE, UA, model, record

NAMES = ("ua", "holdup")


@pytest.mark.parametrize("seed", [0, 1])
def test_a_late_thermometer_is_found_from_the_constants_as_the_model_came(seed: int) -> None:
    data, plain = record("late", seed=seed), model()

    def best(given: tuple[float, ...]) -> tuple[float, np.ndarray]:
        floor = noise_floor([data], (0,))
        search = Search(plain, data, (0,), floor, NAMES, as_given=given, kinds=("lag",))
        with np.errstate(all="ignore"):
            found = search.run(search.base(np.array([UA, 2.5 * HOLDUP])))[0]
        assert [h.label for h in found.hypotheses] == ["thermometer lag"]
        return found.criterion, found.fit.p[[0, 1, -1]]

    stuck, _ = best(())
    gain, found = best(tuple(plain.parameter_values))
    assert gain > stuck + 30, "the same effect, explained far better"
    assert found == pytest.approx([UA, HOLDUP, LATE], rel=0.12)
