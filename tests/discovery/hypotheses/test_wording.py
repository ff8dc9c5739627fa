"""Protects the sentences that compare a quantity at two places, and at two times."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.hypotheses.wording import words_of
from adaptive_flot.greybox import Effect, Model, Quantity, Scope
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


@pytest.mark.parametrize(
    ("site", "size", "said"),
    [
        ("heat_loss", float(np.log(0.7)), "heat loss becomes 30 % smaller, gradually from 90 to 900 s"),
        ("heat_loss", float(np.log(3.0)), "heat loss becomes 3 times as large, gradually from 90 to 900 s"),
        ("thermometer", -2.5, "thermometer comes to show 2.5 K less, gradually from 90 to 900 s"),
    ],
)
def test_a_gradual_change_is_told_with_its_begin_and_end(site: str, size: float, said: str) -> None:
    effect = Effect(site, "time", "ramp", {"amplitude": 0.0, "onset": 90.0, "duration": 810.0}, {})
    found = Hypothesis(site, "time", "ramp", effect, ("amplitude",), ({},))
    assert words_of(tank(), found, lambda name: size) == said


@pytest.mark.parametrize(
    ("begins", "said"),
    [
        ((300.0,), "heat loss is 7 % smaller from 300 to 420 s"),
        ((300.0, 900.0), "heat loss is 7 % smaller while something is switched: 300-420 s, 900-1020 s"),
    ],
)
def test_one_interval_is_not_said_to_be_switched(begins: tuple[float, ...], said: str) -> None:
    """A quantity that wanders is lower for a while, too. Several intervals of one size are no wander."""
    times = {f"on_{k}": a for k, a in enumerate(begins, 1)} | {f"for_{k}": 120.0 for k in range(1, len(begins) + 1)}
    effect = Effect("heat_loss", "time", "switch", times, {"count": float(len(begins)), "width": 2.0})
    found = Hypothesis("heat_loss", "time", "switch", effect, ("amplitude",), ())
    assert words_of(tank(), found, lambda name: float(np.log(0.93))) == said


@pytest.mark.parametrize(
    ("unit", "offset", "slope", "said"),
    [
        ("m3/s", -3.0, -0.3, "gauge shows 30 % too little"),
        ("m3/s", 1.02, 0.1, "gauge shows 10 % too much"),
        (
            "m3/s",
            -2.0,
            -0.3,
            "gauge is wrongly calibrated: -2 m3/s in the middle of its range, and a span 30 % smaller",
        ),
        (
            "m3/s",
            0.0,
            -0.3,
            "gauge is wrongly calibrated: +0 m3/s in the middle of its range, and a span 30 % smaller",
        ),
        (
            "K",
            -3.0,
            -0.3,
            "gauge is wrongly calibrated: -3 K in the middle of its range, and a span 30 % smaller",
        ),
        ("K", 3.0, 0.004, "gauge is wrongly calibrated: +3 K in the middle of its range, and its span is right"),
    ],
)
def test_a_gauge_that_errs_by_one_share_is_told_so(unit: str, offset: float, slope: float, said: str) -> None:
    """The middle of its range is 10. A share of a temperature means nothing."""

    def equations(m: Scope) -> None:
        m.derivative("x", m.input("u"))
        m.output("seen", m.site("gauge", m.state("x"), "sensor", "offset", unit=unit))

    quantities = ((Quantity(name, unit, ""),) for name in ("x", "u", "seen"))
    states, inputs, outputs = quantities
    model = Model("any", states, inputs, (), outputs, equations)
    effect = Effect("gauge", "own_value", "span", {}, {"middle": 10.0})
    found = Hypothesis("gauge", "own_value", "span", effect, ("offset", "slope"), ({},))
    value = dict(zip(found.parameters, (offset, slope), strict=True))
    assert words_of(model, found, value.__getitem__) == said
