"""A fit in innovations form finds how late a sensor is, from near and from far: another simulation is the truth."""

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.cross_validation import model_with
from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.innovations.filter.refit import Refitter
from adaptive_flot.greybox.effects import Effect
from tests.discovery.innovations.late_tank import LATE, TIME, model, record

LAG = Hypothesis(
    "gauge", "lag", "lag", Effect("gauge", "lag", "lag", {"amplitude": 1.0, "time_constant": LATE}, {"scale": 1.0}),
    ("time_constant",), (),
)  # fmt: skip


@pytest.mark.parametrize("seed", [0, 1])
def test_a_late_sensor_is_fitted_alike_from_far_and_from_near(seed: int) -> None:
    late = model_with(model(), LAG)
    fitter = Refitter(late, record(seed, 500, 0.02), (0,), np.array([0.01]), ("time", *LAG.parameters))
    where = late.index("parameters", LAG.parameters[0])
    found = []
    for factor in (0.3, 1.0, 1.6):
        p = late.parameter_values
        p[where] = factor * LATE
        found.append(fitter.fit(p))
    best = max(f.log_likelihood for f in found)
    assert [f.log_likelihood for f in found] == pytest.approx([best] * 3, abs=2.0)
    assert [f.p[where] for f in found] == pytest.approx([LATE] * 3, rel=0.3)


def test_a_size_that_differs_between_stretches_has_a_wider_interval() -> None:
    """The tank's pump gives too much, and by how much wanders slowly: that is no process noise from row to row."""
    offset = Hypothesis(
        "pump", "constant", "offset", Effect("pump", "constant", "shift", mode="offset"), ("amplitude",), ()
    )
    more = model_with(model(), offset)
    plain = record(3, 500, 0.02)
    slow = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 10), 50)
    course = np.convolve(slow, np.exp(-np.arange(200) / TIME) / TIME)[:500]
    deviations = []
    for data in (plain, replace(plain, outputs=plain.outputs + course[:, None])):
        fitter = Refitter(more, data, (0,), np.array([0.01]), offset.parameters)
        fit = fitter.fit(more.parameter_values)
        normal, robust = fitter.covariance(fit), fitter.robust_covariance(fit)
        assert robust[0, 0] >= normal[0, 0]
        deviations.append(np.sqrt([normal[0, 0], robust[0, 0]]))
    # how much wider than what process noise alone explains
    assert deviations[1][1] / deviations[1][0] > 1.5 * deviations[0][1] / deviations[0][0], deviations
