"""Run a scenario for several estimators, controllers and seeds; all of one seed see the same noise and inputs."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd

from adaptive_flot import metrics
from adaptive_flot.batch import BatchFit
from adaptive_flot.errors import located
from adaptive_flot.greybox.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.record import RecordSimulator
from adaptive_flot.greybox.steady_state import steady_state
from adaptive_flot.late import in_time
from adaptive_flot.protocols import PlantRecord, Prior, Sample, Setup, Status
from adaptive_flot.runner.accounts import account, control_account
from adaptive_flot.runner.loop import Step, run_loop
from adaptive_flot.runner.plant import SimulatedPlant
from adaptive_flot.runner.prepared import Prepared
from adaptive_flot.runner.scenario import Scenario

Progress = Callable[[], None]


@dataclass(frozen=True)
class Run:
    """One run.

    Attributes
    ----------
    estimator, controller, seed
        What ran.
    table
        Time series, one row an interval; see `time_series`.
    fit
        Fit in percent of each adapted parameter (by label) and driving output, over t > `fits_after_s`.
    status_counts
        How often the estimator returned which status.
    initial
        The batch fit that gave the initial estimate.
    seconds
        Wall-clock time of the run.
    account
        Recovery, grade and economic value over the same times (see `account`); empty without economics.
    control
        Solve times, statuses and who decided over the same times (see `control_account`); empty without economics.
    """

    estimator: str
    controller: str
    seed: int
    table: pd.DataFrame
    fit: dict[str, float]
    status_counts: dict[str, int]
    initial: BatchFit
    seconds: float
    account: dict[str, float] = field(default_factory=dict)
    control: dict[str, Any] = field(default_factory=dict)

    def summary(self) -> dict[str, object]:
        """Entry of the JSON summary; `account` and `control` only where the scenario has economics."""
        extra = {"account": self.account, "control": self.control} if self.account else {}
        return {
            "estimator": self.estimator,
            "controller": self.controller,
            "seed": self.seed,
            "fit": self.fit,
            "status_counts": self.status_counts,
            "seconds": self.seconds,
            **extra,
        }


def run_scenario(
    scenario: Scenario,
    estimators: Sequence[str] = (),
    seeds: Sequence[int] = (),
    progress: Progress = lambda: None,
) -> list[Run]:
    """Run every combination of estimator, controller and seed.

    Parameters
    ----------
    scenario
        The scenario.
    estimators
        Names among the scenario's estimators, shipped names or `my_file:MyEstimator`; default all of the scenario.
    seeds
        Noise seeds; default those of the scenario.
    progress
        Called after each run.

    Raises
    ------
    PluginError, ScenarioError
        An estimator or controller can not be loaded.
    """
    runs: list[Run] = []
    with located(scenario.path):
        prepared = Prepared.of(scenario, estimators)
        for seed in seeds or scenario.file.seeds:
            # before it starts, no estimator has touched a run: one fit for all with the same controller
            initial: dict[str, dict[str, BatchFit]] = {}
            for controller, name in scenario.combinations(list(prepared.estimators)):
                runs.append(run_one(prepared, name, controller, seed, initial.setdefault(controller, {})))
                progress()
    return runs


def run_one(
    prepared: Prepared, estimator_name: str, controller_name: str, seed: int, initial: dict[str, BatchFit]
) -> Run:
    """Run one combination; `initial` holds the batch fit under "fit" where it is known, and receives it where not.

    Raises
    ------
    PluginError, ScenarioError
        The estimator or controller can not be loaded.
    RangeError
        An input of this seed, or the steady state it starts from, leaves the model's range.
    """
    begin = time.perf_counter()
    scenario, plugin = prepared.scenario, prepared.estimators[estimator_name]
    schedule = scenario.schedule(seed)
    scenario.model.check_inputs(schedule, scenario.starts, where=f"inputs of seed {seed}")
    estimator = prepared.estimator(estimator_name)
    controller = prepared.controller(controller_name, schedule)

    def make_prior(steps: list[Step]) -> Prior:
        if "fit" not in initial:
            initial["fit"] = prepared.batch.fit(record_of(steps, scenario.setup))
        prior = initial["fit"].prior(steps[-1].plant.sample.time)
        return prior if plugin.start == "initial_estimate" else _nominal(scenario, steps, prior)

    steps = run_loop(
        make_plant(scenario, seed),
        estimator,
        controller,
        len(schedule),
        initial_intervals=scenario.initial_rows,
        make_prior=make_prior,
    )
    table = time_series(scenario, steps)
    counts = Counter((s.estimate.status if s.estimate else Status.INITIALISING).name.lower() for s in steps)
    seconds = time.perf_counter() - begin
    return Run(
        estimator_name,
        controller_name,
        seed,
        table,
        fits(scenario, table),
        dict(counts),
        initial["fit"],
        round(seconds, 4),
        *_accounts(scenario, table),
    )


def _accounts(scenario: Scenario, table: pd.DataFrame) -> tuple[dict[str, float], dict[str, Any]]:
    if scenario.prices is None or scenario.limits is None:
        return {}, {}
    late = table[table["time_s"] > scenario.fits_after + 1e-9]
    earned = account(late, scenario.model, scenario.dt, scenario.prices, scenario.limits.grade)
    return earned, control_account(late)


def make_plant(scenario: Scenario, seed: int) -> SimulatedPlant:
    """Plant of a run: at the steady state of its first planned inputs, with its own drift and noise."""
    parameters = scenario.true_parameters()
    x0 = steady_state(scenario.model, scenario.schedule(seed)[0], parameters[0]).state
    noise = measurement_noise(scenario, seed)
    accurate = scenario.file.plant.integrator == "accurate"
    return SimulatedPlant(
        scenario.model, scenario.dt, x0, parameters, noise, accurate=accurate, dead_time=scenario.dead_times
    )


def simulate_plant(scenario: Scenario, seed: int) -> list[PlantRecord]:
    """What the plant of a run shows under the planned inputs, one record an interval, without any estimator."""
    plant = make_plant(scenario, seed)
    state, records = plant.init(), []
    for inputs in scenario.schedule(seed):
        state, record = plant.apply(state, inputs)
        records.append(record)
    return records


def measurement_noise(scenario: Scenario, seed: int) -> FloatArray:
    """White Gaussian noise of a run (N, ny), the same for every estimator; NaN where nothing is measured."""
    generator = np.random.default_rng([seed, 0])
    std = scenario.noise_std()
    noise = std * generator.standard_normal((len(scenario.starts), std.size))
    return np.where(scenario.measured_at(), noise, np.nan)


def record_of(steps: list[Step], setup: Setup) -> Dataset:
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


def _nominal(scenario: Scenario, steps: list[Step], prior: Prior) -> Prior:
    """Nominal parameters and their own free run from the steady state of the first inputs."""
    model, record = scenario.model, record_of(steps, scenario.setup)
    x0 = steady_state(model, record.inputs[0]).state
    state = RecordSimulator(model, scenario.dt).last_state(record, x0, model.parameter_values)
    values = model.parameter_values[model.indices("parameters", scenario.setup.parameters)]
    return Prior(prior.time, state, values, prior.covariance, prior.noise_std)


def time_series(scenario: Scenario, steps: list[Step]) -> pd.DataFrame:
    """Table of a run: `time_s`, inputs, and with suffixes.

    For outputs `_true`, `_measured`, `_predicted`, `_innovation`, `_innovation_std`; for adapted parameters `_true`,
    `_estimate`, `_std`; then `status` of the estimator, `control_status`, `decided_by`, and `solve_seconds` where an
    optimisation ran.
    """
    model, setup = scenario.model, scenario.setup
    estimates = [s.estimate for s in steps]
    columns: dict[str, object] = {"time_s": [s.plant.sample.time for s in steps]}
    inputs = np.vstack([s.plant.sample.inputs for s in steps])
    columns |= {q.column: inputs[:, j] for j, q in enumerate(model.inputs)}
    true = np.vstack([s.plant.outputs for s in steps])
    samples = in_time([s.plant.sample for s in steps], setup)
    measured = np.vstack([s.outputs for s in samples])
    unknown = np.full(len(model.outputs), np.nan)
    predicted = np.vstack([e.prediction if e else unknown for e in estimates])
    innovation = np.vstack([s.outputs for s in in_time(_innovations(steps, unknown), setup)])
    expected = np.vstack([e.innovation_std if e else np.full(len(setup.outputs), np.nan) for e in estimates])
    for j, q in enumerate(model.outputs):
        columns[f"{q.column}_true"] = true[:, j]
        columns[f"{q.column}_predicted"] = predicted[:, j]
        if np.isfinite(measured[:, j]).any():
            columns[f"{q.column}_measured"] = measured[:, j]
            columns[f"{q.column}_innovation"] = innovation[:, j]
        if q.name in setup.outputs:
            columns[f"{q.column}_innovation_std"] = expected[:, setup.outputs.index(q.name)]
    p_true = np.vstack([s.plant.parameters for s in steps])
    blank = np.full(len(setup.parameters), np.nan)
    theta = np.vstack([e.parameters if e else blank for e in estimates])
    std = np.vstack([np.sqrt(np.diag(e.covariance)) if e else blank for e in estimates])
    for j, i in enumerate(model.indices("parameters", setup.parameters)):
        label = model.parameters[i].label
        columns |= {f"{label}_true": p_true[:, i], f"{label}_estimate": theta[:, j], f"{label}_std": std[:, j]}
    columns["status"] = [(e.status if e else Status.INITIALISING).name.lower() for e in estimates]
    columns["control_status"] = [s.decision.status.name.lower() for s in steps]
    columns["decided_by"] = [s.decision.decided_by for s in steps]
    solve = np.array([s.decision.solve_seconds for s in steps])
    if np.isfinite(solve).any():
        columns["solve_seconds"] = solve
    return pd.DataFrame(columns)


def _innovations(steps: list[Step], unknown: FloatArray) -> list[Sample]:
    """Innovations in place of the measurements, those of late values with the sample that they arrived with."""
    return [
        replace(s.plant.sample, outputs=s.estimate.innovation, late=s.estimate.late)
        if s.estimate
        else replace(s.plant.sample, outputs=unknown, late=())
        for s in steps
    ]


def fits(scenario: Scenario, table: pd.DataFrame) -> dict[str, float]:
    """Fits as the paper defines them: adapted parameters, then driving outputs, over t > `fits_after_s`."""
    late = table[table["time_s"] > scenario.fits_after + 1e-9]
    model, setup = scenario.model, scenario.setup
    labels = [model.parameters[i].label for i in model.indices("parameters", setup.parameters)]
    found = {x: metrics.fit(late[f"{x}_true"].to_numpy(), late[f"{x}_estimate"].to_numpy()) for x in labels}
    for i in model.indices("outputs", setup.outputs):
        q = model.outputs[i]
        found[q.name] = metrics.fit(late[f"{q.column}_true"].to_numpy(), late[f"{q.column}_predicted"].to_numpy())
    return found
