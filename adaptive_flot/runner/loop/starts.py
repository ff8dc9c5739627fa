"""Where the estimators of a run start: from the record of its first part, or from nominal parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.contracts import Prior, Setup
from adaptive_flot.contracts.batch import BatchFit
from adaptive_flot.contracts.delayed_measurements import in_time
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.record import RecordSimulator
from adaptive_flot.runner.loop.loop import Step
from adaptive_flot.runner.loop.prepared import Prepared
from adaptive_flot.runner.plants.scenario_plant import initial_state
from adaptive_flot.runner.scenario.scenario import Scenario


def record_of(scenario: Scenario, setup: Setup, steps: Sequence[Step]) -> Dataset:
    """What is known by the last step, as a record that starts one interval before the first, at the initial instant.

    Where the scenario says that the cell does not start steady, that is known too: the record carries the state, in the
    model of the setup.
    """
    samples = in_time([s.plant.sample for s in steps], setup)
    arrays = (np.array([getattr(s, name) for s in samples]) for name in ("time", "inputs", "outputs"))
    return record_of_rows(scenario, setup, *arrays)


def record_of_rows(
    scenario: Scenario, setup: Setup, time: FloatArray, inputs: FloatArray, outputs: FloatArray
) -> Dataset:
    """The same of rows of arrays: times (N,), known inputs (N, nu) and measured outputs (N, ny)."""
    dt = float(time[1] - time[0])
    return Dataset(
        name="initial record",
        time=np.concatenate([[time[0] - dt], time]),
        dt=dt,
        inputs=np.vstack([inputs[0], inputs]),
        outputs=np.vstack([np.full(outputs.shape[1], np.nan), outputs]),
        initial_state=_start(scenario, setup, inputs[0]) if scenario.file.initial_state else None,
    )


def prior_of(prepared: Prepared, estimator: str, setup: Setup, record: Dataset, fit: BatchFit) -> Prior:
    """Where an estimator that is built for `setup` starts after this record: at the batch fit, or as it asks for."""
    prior = fit.prior(float(record.time[-1]))
    if prepared.estimators[estimator].start == "initial_estimate" and setup.model is prepared.scenario.model:
        return prior
    return nominal_start(prepared.scenario, setup, record, prior)


def nominal_start(scenario: Scenario, setup: Setup, record: Dataset, fitted: Prior) -> Prior:
    """Nominal parameters and their own free run from the start, for an estimator that is built for `setup`.

    `record` is that of `record_of` for the same setup. `fitted` is the start that the batch fit of the scenario's own
    setup gives, for its time, covariance and noise.
    """
    model = setup.model
    x0 = _start(scenario, setup, record.inputs[0])
    state = RecordSimulator(model, setup.dt).last_state(record, x0, model.parameter_values)
    values = model.parameter_values[model.indices("parameters", setup.parameters)]
    among = [scenario.setup.parameters.index(name) for name in setup.parameters]
    return Prior(fitted.time, state, values, fitted.covariance[np.ix_(among, among)], fitted.noise_std)


def _start(scenario: Scenario, setup: Setup, inputs: FloatArray) -> FloatArray:
    return initial_state(scenario, setup.model, inputs, setup.model.parameter_values)
