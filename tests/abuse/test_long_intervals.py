"""Sampling intervals far longer than a step of the model: simulated step by step, or refused at once, never a hang."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from adaptive_flot.contracts import Setup
from adaptive_flot.errors import ModelError, ScenarioError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.plugins import ESTIMATORS, construct, load
from adaptive_flot.runner.commands.estimate import estimate_record
from adaptive_flot.runner.commands.record_blocks import Blocks
from adaptive_flot.runner.scenario.loading import load_scenario, shipped_scenarios
from adaptive_flot.runner.scenario.realisation import Realisation

MESSAGE = "a sampling interval of 3600 s takes 3600 steps of model 'flotation', whose longest is 1 s"


@pytest.fixture(scope="module")
def inputs(model: Model) -> FloatArray:
    """Two hours of steady inputs: those of the shipped scenario at its start, the second hour a little different."""
    first = Realisation(load_scenario("paper_scenario_1"), 1).schedule[0]
    return np.vstack([first, first * (1 + 0.01 * np.arange(len(first)))])


def test_an_hour_at_once_equals_its_minutes(model: Model, inputs: FloatArray) -> None:
    """Held inputs: 2 intervals of 3600 s end where 120 of 60 s do, with derivatives too."""
    x0, p, names = steady_state(model, inputs[0]).state, model.parameter_values, [model.parameters[0].name]
    hours, minutes = Stepper(model, 3600.0), Stepper(model, 60.0)
    whole, parts = hours.simulate(x0, inputs), minutes.simulate(x0, np.repeat(inputs, 60, axis=0))
    np.testing.assert_allclose(whole.states, parts.states[59::60], rtol=1e-10)
    start = np.zeros((len(x0), 1))
    by_hour = hours.simulate_sensitivities(x0, inputs[:1], p, names, start)
    by_minute = minutes.simulate_sensitivities(x0, np.repeat(inputs[:1], 60, axis=0), p, names, start)
    np.testing.assert_allclose(by_hour.gradient[0], by_minute.gradient[-1], rtol=1e-8)


@pytest.mark.parametrize("name", ["fixed", "rpem", "ekf", "mhe", "adaptive_imm"])
def test_estimator_refuses_an_interval_of_too_many_steps(model: Model, name: str) -> None:
    setup = Setup(model, 3600.0, (model.parameters[0].name,), (model.outputs[0].name,))
    with pytest.raises(ModelError) as caught:
        construct(load(name, ESTIMATORS, "estimator"), name, "estimator", setup)
    assert MESSAGE in str(caught.value) and "sample more often" in str(caught.value)


def test_record_is_refused_before_it_is_fitted(model: Model, inputs: FloatArray) -> None:
    n = 40
    level = np.full((n, len(model.outputs)), 0.5)
    record = Dataset("hourly", 3600.0 * np.arange(n, dtype=float), 3600.0, np.repeat(inputs, n // 2, axis=0), level)
    called: list[str] = []
    blocks = Blocks("hourly", record, record, continues=False)
    with pytest.raises(ModelError, match="hourly: a sampling interval of 3600 s"):
        estimate_record(blocks, model, progress=called.append)
    assert not called


@pytest.mark.parametrize(
    ("duration", "sampling", "kind", "part"),
    [
        (360_000, 3600, ModelError, f"sampling_s: {MESSAGE}"),
        (1e9, 1e7, ModelError, "sampling_s: a sampling interval of 1e+07 s takes 1e+07 steps"),
        (1e7, 1, ScenarioError, "must be a whole number (2 to 2e+06) of sampling_s intervals"),
        (1e300, 1, ScenarioError, "must be a whole number"),
        (1, 1e-300, ScenarioError, "must be a whole number"),
    ],
)
def test_scenario_is_refused_when_it_is_read(
    tmp_path: Path, duration: float, sampling: float, kind: type[Exception], part: str
) -> None:
    content = yaml.safe_load(shipped_scenarios()["paper_scenario_1"].read_text())
    file = tmp_path / "long.yaml"
    file.write_text(yaml.safe_dump({**content, "duration_s": duration, "sampling_s": sampling}))
    with pytest.raises(kind) as caught:
        load_scenario(file)
    assert str(caught.value).startswith(f"{file}: ") and part in str(caught.value)
