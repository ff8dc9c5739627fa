"""What is looked for does not depend on how fast a process is: times count in sampling intervals, not in seconds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.discovery.hypotheses.cross_validation import model_with
from adaptive_flot.discovery.hypotheses.families import Hypothesis, hypotheses
from adaptive_flot.discovery.innovations.courses import suspects
from tests.discovery.innovations.thermostat import model

PLATE = model()
RNG = np.random.default_rng(3)
ROWS = 400
SEEN = {s.name: np.cumsum(RNG.normal(size=ROWS)) + 3.0 for s in PLATE.sites}
DRIVERS = {"asked": SEEN["element"], "plate": SEEN["thermometer"]}
TIMES = ("time_constant", "follow_s")


def _times(h: Hypothesis) -> list[float]:
    told = {**h.effect.coefficients, **h.effect.settings}
    found = [float(told[name]) for name in TIMES if name in told]  # type: ignore[arg-type]
    found += [start[name] for start in h.starts for name in TIMES if name in start]
    found += [end for name in TIMES if name in h.limits for end in h.limits[name]]
    return found + [h.scales[name] for name in TIMES if name in h.scales]


def _all(dt: float) -> list[Hypothesis]:
    found = [s.hypothesis for s in suspects(PLATE, SEEN, DRIVERS, dt)]
    return [*found, *hypotheses(PLATE, SEEN, DRIVERS, dt, ROWS * dt)]


@settings(max_examples=20, deadline=None)
@given(dt=st.floats(1e-3, 1e4))
def test_a_process_that_is_so_much_faster_has_the_same_suspects(dt: float) -> None:
    usual, other = _all(1.0), _all(dt)
    assert [h.label for h in other] == [h.label for h in usual]
    assert {"element lag", "thermometer lag", "loss store by plate"} <= {h.label for h in other}
    for a, b in zip(usual, other, strict=True):
        np.testing.assert_allclose(_times(b), np.array(_times(a)) * dt, rtol=1e-9)


def test_each_time_that_is_fitted_has_a_scale_of_its_record() -> None:
    """Of a store of days a fit moves in days; that of a motor in hundredths of a second."""
    for dt in (0.02, 300.0):
        for h in _all(dt):
            for name in set(h.free) & {"time_constant"}:
                extended = model_with(PLATE, h.with_scales(h.effect.coefficients, "offset"))
                parameter = extended.parameters[extended.index("parameters", h.effect.parameter(name))]
                assert dt <= parameter.scale <= 1000 * dt, h.label


@pytest.mark.parametrize(("mode", "scale"), [("offset", 40.0), ("factor", 0.1)])
def test_a_change_in_the_unit_of_its_site_has_its_own_size_for_a_scale(mode: str, scale: float) -> None:
    """A tenth is much of a factor, and nothing of a heat in watts."""
    found = next(
        s.hypothesis for s in suspects(PLATE, SEEN, DRIVERS, 10.0) if s.hypothesis.label == "loss depends by plate"
    )
    effect = found.effect.__class__("loss", "plate", "curve", settings=found.effect.settings, mode=mode)  # type: ignore[arg-type]
    sized = Hypothesis("loss", "plate", "depends", effect, found.free, ({},))
    extended = model_with(PLATE, sized.with_scales({"value_1": -40.0, "value_2": 40.0}, "offset"))
    assert extended.parameters[extended.index("parameters", effect.parameter("value_1"))].scale == pytest.approx(scale)
