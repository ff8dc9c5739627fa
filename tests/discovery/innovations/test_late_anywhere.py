"""Lags in a row commute: what a late actuator does, a late sensor does as well, where nothing wanders in between."""

import numpy as np
import pytest

from adaptive_flot.discovery.innovations.judge import judge
from adaptive_flot.discovery.innovations.search import Search
from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope

DT, TIME, LATE = 1.0, 40.0, 8.0


def model() -> Model:
    """x' = (pump - x) / T, shown by a gauge."""

    def equations(m: Scope) -> None:
        x = m.state("x")
        pump = m.site("pump", m.input("u"), "actuator")
        m.derivative("x", (pump - x) / m.parameter("time"))
        m.output("y", m.site("gauge", x, "sensor", "offset"))

    return Model(
        name="tank",
        states=(Quantity("x", "", "", scale=1.0),),
        inputs=(Quantity("u", "", ""),),
        parameters=(Parameter("time", TIME, "s", "", lower=20.0, upper=100.0, scale=10.0, role="estimated"),),
        outputs=(Quantity("y", "", "", scale=1.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"x": 0.0},
    )


def record(seed: int) -> Dataset:
    """A late gauge, and nothing that wanders; Euler, twenty steps a row."""
    rng, rows = np.random.default_rng(seed), 300
    u = np.repeat(rng.choice([-1.0, 1.0], rows // 20), 20)
    x, shown, y = 0.0, 0.0, []
    for k in range(rows):
        for _ in range(20):
            x += DT / 20 * (u[k] - x) / TIME
            shown += DT / 20 * (x - shown) / LATE
        y.append(shown + 0.01 * rng.standard_normal())
    return Dataset("tank", DT * np.arange(1.0, rows + 1), DT, u[:, None], np.array(y)[:, None])


@pytest.mark.parametrize("seed", [0, 1])
def test_a_late_gauge_is_told_together_with_a_late_pump(seed: int) -> None:
    search = Search(model(), record(seed), (0,), np.array([0.01]), ("time",))
    base = search.base(model().parameter_values)
    told = judge(search, base, search.run(base))
    assert told.word == "class", told.why
    assert {h.site for _, h in told.open} == {"pump", "gauge"} and not told.certain
    first, second = (e.criterion for e, _ in told.open)
    assert first == pytest.approx(second, abs=5.0), "as likely, but for how the first rows start"
    late = [search.model_of(e).parameters[-1].value for e, _ in told.open]
    assert late == pytest.approx([LATE] * 2, rel=0.15)
