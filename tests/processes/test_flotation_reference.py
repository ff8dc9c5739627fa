"""The cell against two implementations of it that share no code with this project: stored trajectories and SciPy."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.greybox.data.dataset import read_dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.greybox.stepping.trajectory import Trajectory
from benchmarks.timing import scipy_reference as reference

GIVEN = {"time_s", "air_flow_m3_s", "feed_flow_m3_s", "level_setpoint_m", "n", "C"}
TOLERANCE = {"accurate": 1e-6, "fast": 1e-4}
integrators = pytest.mark.parametrize("integrator", ["accurate", "fast"])


@pytest.fixture
def stepper(integrator: str, accurate: Stepper, fast: Stepper) -> Stepper:
    return accurate if integrator == "accurate" else fast


def columns(model: Model, run: Trajectory) -> dict[str, list[FloatArray]]:
    """Everything the model computes, by column name; a quantity that is a state and an output is there twice."""
    found: dict[str, list[FloatArray]] = {}
    for quantities, table in (
        (model.states, run.states), (model.outputs, run.outputs), (model.signals, run.signals),
    ):  # fmt: skip
        for quantity, column in zip(quantities, table.T, strict=True):
            found.setdefault(quantity.column, []).append(column)
    return found


def rows_with_froth(model: Model, n: FloatArray, c: FloatArray) -> FloatArray:
    """Parameter vector of each row (N, np) with n and C as given."""
    p = np.tile(model.parameter_values, (len(n), 1))
    p[:, model.indices("parameters", ["n", "C"])] = np.column_stack([n, c])
    return p


def largest_errors(run: dict[str, list[FloatArray]], truth: dict[str, FloatArray]) -> dict[str, float]:
    """Largest error of each column over its largest magnitude."""
    return {
        name: max(float(np.max(np.abs(found - column))) for found in run[name]) / float(np.max(np.abs(column)))
        for name, column in truth.items()
    }


@integrators
@pytest.mark.parametrize("name", ["steps", "scenario1", "scenario2"])
def test_every_column_of_the_stored_trajectories(
    model: Model, stepper: Stepper, integrator: str, shared_file: Callable[[str], Path], name: str
) -> None:
    """From the state of row 0 with the inputs, n and C of each row: all 17 outputs, states and signals."""
    file = shared_file(f"reference/{name}.csv")
    table = pd.read_csv(file)
    record = read_dataset(file, model)
    assert record.initial_state is not None
    p = rows_with_froth(model, table["n"].to_numpy()[1:], table["C"].to_numpy()[1:])
    run = columns(model, stepper.simulate(record.initial_state, record.inputs[1:], p))
    truth = {c: table[c].to_numpy()[1:] for c in table.columns if c not in GIVEN}
    assert len(truth) == 17
    errors = largest_errors(run, truth)
    assert max(errors.values()) < TOLERANCE[integrator], errors


@pytest.mark.parametrize("name", ["steps", "scenario1", "scenario2"])
def test_first_row_of_the_stored_trajectories(
    model: Model, fast: Stepper, shared_file: Callable[[str], Path], name: str
) -> None:
    """Outputs and signals at one instant need no step: an error here is an error in the closures."""
    file = shared_file(f"reference/{name}.csv")
    first = pd.read_csv(file).iloc[0]
    record = read_dataset(file, model)
    assert record.initial_state is not None
    p = rows_with_froth(model, np.array([first["n"]]), np.array([first["C"]]))[0]
    row = fast.outputs_at(record.initial_state, 0.0, record.inputs[0], p)
    for quantity, value in zip((*model.outputs, *model.signals), row, strict=True):
        if quantity.column in first:
            assert value == pytest.approx(first[quantity.column], rel=1e-6), quantity.name


@integrators
@pytest.mark.parametrize("seed", [0, 1])
def test_random_record_of_the_scipy_reference(model: Model, stepper: Stepper, integrator: str, seed: int) -> None:
    """Air, feed and set-point jump every 15 s, n and C move with them; LSODA with an inner root find."""
    rng = np.random.default_rng(seed)
    low, high = [9.05e-4, 1.3e-4, 0.34, 0.95, 6e-4], [2.17e-3, 2.2e-4, 0.42, 1.25, 8e-4]
    held = np.repeat(rng.uniform(low, high, (10, 5)), 15, axis=0)
    u, theta = held[:, :3], held[:, 3:]
    x0 = reference.steady_state(u[0], theta[0])
    states, outputs = reference.simulate(u, theta, x0, rtol=1e-11)
    run = columns(model, stepper.simulate(x0, u, rows_with_froth(model, *theta.T)))
    truth = outputs | {q.column: column for q, column in zip(model.states, states.T, strict=True)}
    assert len(truth) == 17
    errors = largest_errors(run, truth)
    assert max(errors.values()) < TOLERANCE[integrator], errors
