"""Where the estimators of a run start: from the record of its first part, or from nominal parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.greybox.dataset import Dataset
from adaptive_flot.greybox.record import RecordSimulator
from adaptive_flot.greybox.steady_state import steady_state
from adaptive_flot.late import in_time
from adaptive_flot.protocols import Prior, Setup
from adaptive_flot.runner.loop import Step
from adaptive_flot.runner.scenario import Scenario


def record_of(steps: Sequence[Step], setup: Setup) -> Dataset:
    """What is known by the last step, as a record that starts one interval before the first, at the initial instant."""
    samples = in_time([s.plant.sample for s in steps], setup)
    dt = samples[1].time - samples[0].time
    return Dataset(
        name="initial record",
        time=np.array([samples[0].time - dt, *(s.time for s in samples)]),
        dt=dt,
        inputs=np.vstack([samples[0].inputs, *(s.inputs for s in samples)]),
        outputs=np.vstack([np.full(samples[0].outputs.size, np.nan), *(s.outputs for s in samples)]),
    )


def nominal_start(scenario: Scenario, steps: Sequence[Step], prior: Prior) -> Prior:
    """Nominal parameters and their own free run from the steady state of the first inputs."""
    model, record = scenario.model, record_of(steps, scenario.setup)
    x0 = steady_state(model, record.inputs[0]).state
    state = RecordSimulator(model, scenario.dt).last_state(record, x0, model.parameter_values)
    values = model.parameter_values[model.indices("parameters", scenario.setup.parameters)]
    return Prior(prior.time, state, values, prior.covariance, prior.noise_std)
