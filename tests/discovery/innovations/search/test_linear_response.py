"""The response of the innovations against differences of two runs of the filter itself."""

import math

import numpy as np
import pytest

from adaptive_flot.discovery.innovations.filter import linear_response
from adaptive_flot.discovery.innovations.filter.linear_response import ResponseFunctions
from adaptive_flot.discovery.innovations.filter.noise_fit import search_noise
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.filtering import NoiseModel, RecordFilter
from tests.discovery.innovations.box import DT, model, record

NOISE = NoiseModel({"air": 0.02, "wall": 0.01}, {"thermometer": 0.05}, degrees_of_freedom=float("inf"))
START = (np.array([22.0, 22.0]), np.diag([4.0, 4.0]))


@pytest.mark.parametrize("site", ["heater", "loss", "thermometer", "other_heat"])
def test_a_step_at_a_site_moves_the_innovations_as_the_regression_says(site: str) -> None:
    plain, data, at = model(), record(rows=80), 40
    size = 1e-3
    late = DT / 2 if site == "thermometer" else 0.0  # what acts on a state begins with an interval
    onset = {"amplitude": size, "onset": float(data.time[at]) + late}
    extended = plain.with_effects([Effect(site, "time", "step", onset, {"width": DT / 50}, mode="offset")])
    before, after = (
        RecordFilter(m, DT, [0], (), float("inf")).run(data, NOISE, *START, m.parameter_values)
        for m in (plain, extended)
    )
    moved = -(after.predicted - before.predicted)[1:, 0] / np.sqrt(before.variance[1:, 0])
    functions = ResponseFunctions(plain, DT, [0], [site])
    response = functions.at(data, NOISE, plain.parameter_values, START)
    course = (np.arange(len(data) - 1) >= at).astype(float)[:, None]
    said = -size * response.respond(site, course)[:, 0]
    # the rounded edge of the step differs from a sharp one in its own interval
    np.testing.assert_allclose(moved[at + 2 :], said[at + 2 :], atol=0.03 * np.abs(said).max())
    assert np.abs(moved[: at - 1]).max() == pytest.approx(0.0, abs=1e-9)


def test_constants_move_the_innovations_as_the_derivatives_say() -> None:
    """But for the gain of the filter, which moves with them a little and is held."""
    plain, data, step = model(), record(rows=80), 1e-4
    changed = plain.with_parameters({"conductance": 0.6 + step})
    before, after = (
        RecordFilter(m, DT, [0], (), float("inf")).run(data, NOISE, *START, m.parameter_values)
        for m in (plain, changed)
    )
    moved = (after.predicted - before.predicted)[1:, 0] / np.sqrt(before.variance[1:, 0]) / step
    response = ResponseFunctions(plain, DT, [0], (), ["conductance"]).at(data, NOISE, plain.parameter_values, START)
    np.testing.assert_allclose(response.by_constants[:, 0], moved, atol=0.03 * np.abs(moved).max())


def test_a_system_without_a_solution_is_nan_and_spoils_no_other() -> None:
    """A trial with a factor of e^20 at a sensor: two outputs are the same to the last digit. It ended the program."""
    systems = np.array([[[2.0, 0.0], [0.0, 4.0]], [[1e18, 1e18], [1e18, 1e18]], [[np.nan, 0.0], [0.0, 1.0]]])
    found = linear_response._solved(systems, np.ones((3, 2, 1)))
    np.testing.assert_allclose(found[0, :, 0], [0.5, 0.25])
    assert np.isnan(found[1:]).all()


def test_the_noise_search_finds_the_minimum_of_a_known_cost() -> None:
    def cost(theta: float, rho: float) -> float:
        return math.log(theta / 0.02) ** 2 + math.log(rho / 1.5) ** 2

    (theta, rho), _ = search_noise(lambda sizes: [cost(*size) for size in sizes])
    assert theta == pytest.approx(0.02, rel=0.1) and rho == pytest.approx(1.5, rel=0.1)
