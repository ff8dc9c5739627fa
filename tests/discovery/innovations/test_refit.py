"""A fit in innovations form finds how late a sensor is, from near and from far: another simulation is the truth."""

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.cross_validation import model_with
from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.innovations.refit import Refitter
from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.effects import Effect

DT, TIME, LATE = 1.0, 40.0, 6.0
LAG = Hypothesis(
    "gauge", "lag", "lag", Effect("gauge", "lag", "lag", {"amplitude": 1.0, "time_constant": LATE}, {"scale": 1.0}),
    ("time_constant",), (),
)  # fmt: skip


def tank() -> Model:
    """x' = (u - x) / T, shown by a gauge; T is known to be the slower one of the two lags in a row."""

    def equations(m: Scope) -> None:
        x = m.state("x")
        m.derivative("x", (m.input("u") - x) / m.parameter("time"))
        m.output("y", m.site("gauge", x, "sensor", "offset"))

    return Model(
        name="tank",
        states=(Quantity("x", "", "", scale=1.0),),
        inputs=(Quantity("u", "", ""),),
        parameters=(Parameter("time", TIME, "s", "", lower=20.0, upper=1000.0, scale=10.0, role="estimated"),),
        outputs=(Quantity("y", "", "", scale=1.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
    )


def record(seed: int) -> Dataset:
    """The tank with noise on its balance, and a gauge that is late; exact for inputs that are held."""
    rng, rows = np.random.default_rng(seed), 500
    u = np.repeat(rng.choice([-1.0, 1.0], rows // 20), 20)
    x, shown, y = 0.0, 0.0, []
    for k in range(rows):
        for _ in range(20):
            x += DT / 20 * (u[k] - x) / TIME + 0.02 * np.sqrt(DT / 20) * rng.standard_normal()
            shown += DT / 20 * (x - shown) / LATE
        y.append(shown + 0.01 * rng.standard_normal())
    return Dataset("tank", DT * np.arange(1.0, rows + 1), DT, u[:, None], np.array(y)[:, None])


@pytest.mark.parametrize("seed", [0, 1])
def test_a_late_sensor_is_fitted_alike_from_far_and_from_near(seed: int) -> None:
    model = model_with(tank(), LAG)
    fitter = Refitter(model, record(seed), (0,), np.array([0.01]), ("time", *LAG.parameters))
    where = model.index("parameters", LAG.parameters[0])
    found = []
    for factor in (0.3, 1.0, 1.6):
        p = model.parameter_values
        p[where] = factor * LATE
        found.append(fitter.fit(p))
    best = max(f.log_likelihood for f in found)
    assert [f.log_likelihood for f in found] == pytest.approx([best] * 3, abs=2.0)
    assert [f.p[where] for f in found] == pytest.approx([LATE] * 3, rel=0.3)
