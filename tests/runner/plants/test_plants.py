"""Plants and the loop around them."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.contracts import (
    ControllerSetup,
    Decision,
    Estimate,
    Prior,
    Sample,
    Setup,
    Status,
)
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.runner.loop.loop import Step, run_loop
from adaptive_flot.runner.plants.plant import ReplayPlant, SimulatedPlant
from controllers.schedule import Schedule, ScheduleState
from estimators.fixed import Fixed
from tests.estimators import toys

DECAY = toys.decay(a=0.5, b=1.0)


def record() -> Dataset:
    generator = np.random.default_rng(0)
    data = toys.record(DECAY, generator.normal(size=8), x0=(0.3,))
    data.outputs[3] = np.nan
    return data


def test_replay_shows_the_rows_after_the_first_whatever_the_inputs_are() -> None:
    data = record()
    plant = ReplayPlant(data, parameter_count=2)
    state = plant.init()
    for k in range(1, len(data)):
        state, shown = plant.apply(state, np.array([99.0]))
        assert shown.sample.time == data.time[k]
        np.testing.assert_array_equal(shown.sample.inputs, data.inputs[k])
        np.testing.assert_array_equal(shown.sample.outputs, data.outputs[k])
        assert np.isnan(shown.outputs).all() and np.isnan(shown.parameters).all() and shown.parameters.shape == (2,)


def test_simulated_plant_is_the_recursion_by_hand() -> None:
    """x+ = e^-a x + b (1 - e^-a) u / a: the step of the linear model, with its own parameters every interval."""
    u, noise = np.array([1.0, -2.0, 0.5]), np.array([[0.1], [np.nan], [-0.2]])
    parameters = np.array([[0.5, 1.0], [0.6, 1.1], [0.7, 1.2]])
    plant = SimulatedPlant(DECAY, 1.0, np.array([0.3]), parameters, noise)
    state, x = plant.init(), 0.3
    for k in range(3):
        a, b = parameters[k]
        x = np.exp(-a) * x + b * (1 - np.exp(-a)) * u[k] / a
        state, shown = plant.apply(state, u[k : k + 1])
        assert shown.sample.time == k + 1.0
        assert shown.outputs[0] == pytest.approx(x, abs=5e-3)
        assert shown.sample.outputs[0] == pytest.approx(shown.outputs[0] + noise[k, 0], nan_ok=True)
        np.testing.assert_array_equal(shown.parameters, parameters[k])


def test_simulated_plant_can_be_resumed_and_keeps_its_states_apart() -> None:
    plant = SimulatedPlant(DECAY, 1.0, np.array([0.3]), np.tile([0.5, 1.0], (4, 1)), np.zeros((4, 1)))
    states = [plant.init()]
    for _ in range(3):
        states.append(plant.apply(states[-1], np.ones(1))[0])
    again, _ = plant.apply(states[1], np.ones(1))
    np.testing.assert_array_equal(again.x, states[2].x)
    np.testing.assert_array_equal(plant.init().x, [0.3])


class Recorder(Schedule):
    """Keeps what it is shown."""

    def __init__(self, setup: ControllerSetup) -> None:
        super().__init__(setup)
        self.shown: list[tuple[Sample | None, Estimate | None]] = []

    def decide(
        self, state: ScheduleState, sample: Sample | None, estimate: Estimate | None
    ) -> tuple[ScheduleState, Decision]:
        self.shown.append((sample, estimate))
        return super().decide(state, sample, estimate)


def run(intervals: int, initial: int) -> tuple[list[Step], Recorder, list[int]]:
    inputs: FloatArray = np.arange(intervals, dtype=float)[:, None]
    plant = SimulatedPlant(DECAY, 1.0, np.zeros(1), np.tile([0.5, 1.0], (intervals, 1)), np.zeros((intervals, 1)))
    recorder, handed = Recorder(ControllerSetup(DECAY, 1.0, inputs)), []

    def prior(steps: list[Step]) -> Prior:
        handed.append(len(steps))
        last = steps[-1].plant.outputs if steps else np.zeros(1)
        return Prior(float(len(steps)), last, np.array([0.5, 1.0]), np.eye(2), np.ones(1))

    estimator = Fixed(Setup(DECAY, 1.0, ("a", "b"), ("y",)))
    return (
        run_loop(plant, estimator, recorder, intervals, initial_intervals=initial, make_prior=prior),
        recorder,
        handed,
    )


@pytest.mark.parametrize("initial", [0, 3])
def test_the_estimator_starts_after_the_initial_intervals_with_the_steps_so_far(initial: int) -> None:
    steps, _, handed = run(6, initial)
    assert handed == [initial]
    assert [s.estimate is None for s in steps] == [True] * initial + [False] * (6 - initial)
    for s in steps[initial:]:
        assert s.estimate is not None and s.estimate.status is Status.OK
        np.testing.assert_allclose(s.estimate.innovation, 0.0, atol=1e-12)


def test_a_decision_sees_the_last_sample_and_estimate_and_none_before_the_first() -> None:
    steps, recorder, _ = run(6, 3)
    assert recorder.shown[0] == (None, None)
    for k in range(1, 6):
        sample, estimate = recorder.shown[k]
        assert sample is steps[k - 1].plant.sample and estimate is steps[k - 1].estimate


def test_the_plant_gets_what_the_controller_decided() -> None:
    steps, _, _ = run(5, 0)
    assert [float(s.plant.sample.inputs[0]) for s in steps] == [0, 1, 2, 3, 4]
    assert all(s.decision.decided_by == "schedule" for s in steps)


def test_schedule_holds_its_last_row_after_the_end() -> None:
    controller = Schedule(ControllerSetup(DECAY, 1.0, np.array([[1.0], [2.0]])))
    state, decided = controller.init(0.0), []
    for _ in range(4):
        state, decision = controller.decide(state, None, None)
        decided.append(float(decision.inputs[0]))
    assert decided == [1.0, 2.0, 2.0, 2.0]
