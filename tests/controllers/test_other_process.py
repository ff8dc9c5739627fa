"""Controllers on a process that is no flotation cell: the cascaded tanks, with economics and limits of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.contracts import AnyController, ControllerSetup, Limits, OperatingPoint, Prior, Sample, Setup, Status
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox import FloatArray, Model, Stepper, steady_state
from adaptive_flot.processes.cascaded_tanks import PumpingEconomics, make_model
from controllers.economic_mpc.controller import EconomicMpc
from controllers.economic_mpc.solvers.nlp_solvers import SOLVERS
from controllers.hold import Hold
from controllers.pi import Pi
from estimators.fixed import Fixed

DT, START, ROWS = 5.0, 1.5, 300
"""Sampling interval [s], pump voltage at the start [V], samples of a run: 25 minutes."""


def setup(level: tuple[float, float], upper: float = 20.0) -> ControllerSetup:
    """Of the tanks, with a range of the measured level [V], and a highest level of the upper tank [V]."""
    limits = Limits(
        outputs={"level": level},
        inputs={"pump_voltage": (0.0, 5.0)},
        moves={"pump_voltage": 0.5},
        states={"upper_level": (0.0, upper)},
    )
    return ControllerSetup(make_model(), DT, np.array([[START]]), ("upper_outflow",), limits, PumpingEconomics())


def mpc(level: tuple[float, float], solver: str = "ipopt", upper: float = 20.0, horizon: int = 20) -> EconomicMpc:
    return EconomicMpc(setup(level, upper), horizon=horizon, move_s=30.0, solver=solver)


def closed_loop(controller: AnyController, plant: Model) -> tuple[FloatArray, FloatArray, float]:
    """Measured level [V] and pump voltage [V] of a run, (ROWS,) each, and its value [cu]; nothing is adapted."""
    model, economics = make_model(), PumpingEconomics()
    start = steady_state(plant, np.array([START])).state
    estimator = Fixed(Setup(model, DT, ("upper_outflow",), ("level",)))
    belief = estimator.init(Prior(0.0, start, np.array([0.05]), np.eye(1), np.array([0.01])))
    step, x, levels, voltages, value = Stepper(plant, DT).call, start, [], [], 0.0
    state, decision = controller.decide(controller.init(0.0), None, None)
    for k in range(ROWS):
        u = decision.inputs
        x, y, _ = step(x, DT * k, u, plant.parameter_values)
        sample = Sample(DT * (k + 1), u, y)
        belief, estimate = estimator.update(belief, sample)
        state, decision = controller.decide(state, sample, estimate)
        assert decision.status in (Status.OK, Status.SOFTENED)  # the start may lie beyond a limit
        rates = economics.rates(OperatingPoint(plant, x, u, y, plant.parameter_values), economics.prices())
        levels.append(y[0])
        voltages.append(u[0])
        value += DT * float(sum(rates.values()))
    return np.array(levels), np.array(voltages), value


def test_without_a_limit_it_pumps_at_the_best_voltage() -> None:
    """Known answer: u = 2 / (3 * 0.25) V, where worth of the level and cost of the pump balance; and it earns more.

    The plan sees no worth beyond its end, so the horizon is nine of the slower tank's time constants.
    """
    level, voltage, value = closed_loop(mpc((0.0, np.inf), horizon=32), make_model())
    best = 2 / (3 * 0.25)
    np.testing.assert_allclose(voltage[-60:], best, rtol=0.02)
    np.testing.assert_allclose(level[-60:], best**2, rtol=0.04)
    assert value > 1.2 * closed_loop(Hold(setup((0.0, np.inf))), make_model())[2]


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_level_limit_holds_though_the_model_is_off(solver: str) -> None:
    """The best level is 7.1 V, the limit 5 V; the plant's lower hole is 5 % narrower, which alone makes it 5.5 V."""
    plant = make_model().with_parameters({"lower_outflow": 0.0475})
    level, voltage, _ = closed_loop(mpc((0.0, 5.0), solver), plant)
    assert level.max() < 5.05
    np.testing.assert_allclose(level[-60:], 5.0, atol=0.05)
    np.testing.assert_allclose(voltage[-60:], np.sqrt(5.0) * 0.95, rtol=0.02)


def test_a_lower_limit_holds_against_the_price() -> None:
    """At a price of pumping four times as high the best level is 0.4 V; the limit keeps 3 V."""
    dear = replace(setup((3.0, np.inf)), economics=PumpingEconomics(pumping=1.0))
    controller = EconomicMpc(dear, limit_penalty=10.0)
    level, _, _ = closed_loop(controller, make_model())
    np.testing.assert_allclose(level[-60:], 3.0, atol=0.05)


def test_the_range_of_a_state_is_kept() -> None:
    """The upper tank, which nobody measures, may fill to 4 V: the lower one then stays at 4 V too."""
    level, _, _ = closed_loop(mpc((0.0, np.inf), upper=4.0), make_model())
    assert level.max() < 4.1
    np.testing.assert_allclose(level[-60:], 4.0, atol=0.1)


def test_a_plan_tells_the_limited_outputs_by_name() -> None:
    controller = mpc((0.0, 5.0))
    x = steady_state(make_model(), np.array([START])).state
    estimator = Fixed(Setup(make_model(), DT, ("upper_outflow",), ("level",)))
    prior = Prior(0.0, x, np.array([0.05]), np.eye(1), np.array([0.01]))
    sample = Sample(DT, np.array([START]), x[1:])
    _, estimate = estimator.update(estimator.init(prior), sample)
    _, decision = controller.decide(controller.decide(controller.init(0.0), None, None)[0], sample, estimate)
    plan = decision.plan
    assert plan is not None and list(plan.inputs) == ["pump_voltage"] and list(plan.outputs) == ["level"]
    held = np.repeat(plan.inputs["pump_voltage"], 6)[:, None]
    ahead = Stepper(make_model(), DT).simulate(estimate.state, held)
    np.testing.assert_allclose(plan.outputs["level"], ahead.outputs[5::6, 0], rtol=5e-3)


def test_pi_holds_the_level_though_more_of_the_input_raises_it() -> None:
    """The sign of the gain follows the process: in a flotation cell more air lowers the grade."""
    controller = Pi(setup((0.0, 5.0)), margin=0.2, crossover_rad_s=0.005)
    assert controller.gain < 0 and controller.setpoint == pytest.approx(0.2)
    upper_only = Pi(setup((-np.inf, 3.0)), margin=0.2, crossover_rad_s=0.005)
    level, _, _ = closed_loop(upper_only, make_model())
    np.testing.assert_allclose(level[-60:], 2.8, atol=0.05)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"outputs": {"levl": (0.0, 5.0)}}, "did you mean 'level'"),
        ({"states": {"uper_level": (0.0, 5.0)}}, "did you mean 'upper_level'"),
        ({"inputs": {"pump": (0.0, 5.0)}, "moves": {"pump": 1.0}}, "known: pump_voltage"),
        ({"moves": {}}, "give both for each input"),
    ],
)
def test_limits_of_what_the_model_lacks_are_one_line(changes: dict[str, object], says: str) -> None:
    made = setup((0.0, 5.0))
    assert made.limits is not None
    with pytest.raises(ModelError, match=says) as caught:
        EconomicMpc(replace(made, limits=replace(made.limits, **changes)))  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


def test_rates_that_are_not_the_terms_are_one_line() -> None:
    class Wrong(PumpingEconomics):
        def rates(self, point: OperatingPoint, prices: object) -> dict[str, object]:
            return {"lvel": point.output("level")}

    with pytest.raises(ModelError, match=r"rates of the economics are .*lvel"):
        EconomicMpc(replace(setup((0.0, 5.0)), economics=Wrong()))
