"""Run a scenario for several estimators, controllers and seeds; all of one seed see the same noise and inputs."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from adaptive_flot.contracts import AnyController, AnyEstimator, Prior, Status
from adaptive_flot.contracts.batch import BatchFit
from adaptive_flot.errors import located
from adaptive_flot.greybox.model import Model
from adaptive_flot.runner.adaptation.inquiry import Inquiry
from adaptive_flot.runner.adaptation.supervision import supervision
from adaptive_flot.runner.loop.loop import MakePrior, Step, Supervise, run_loop, unwatched
from adaptive_flot.runner.loop.prepared import Prepared
from adaptive_flot.runner.loop.starts import nominal_start, record_of
from adaptive_flot.runner.plants.fault_injection import with_faults
from adaptive_flot.runner.plants.scenario_plant import make_plant
from adaptive_flot.runner.results.accounts import account, control_account
from adaptive_flot.runner.results.plans import plan_table
from adaptive_flot.runner.results.timeseries import fits, time_series
from adaptive_flot.runner.scenario.checks import check_truth
from adaptive_flot.runner.scenario.scenario import Scenario

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
    fault_counts
        Intervals in which each injected fault changed something; empty without faults.
    plans
        What the controller expected, one row a planned move (see `plan_table`); empty where it makes no plans.
    inquiries
        What came of each alarm of a watched estimator; None where the estimator was not watched.
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
    fault_counts: dict[str, int] = field(default_factory=dict)
    plans: pd.DataFrame = field(default_factory=pd.DataFrame)
    inquiries: Sequence[Inquiry] | None = None

    def summary(self) -> dict[str, object]:
        """Entry of the JSON summary; some of its keys only where they apply."""
        extra: dict[str, object] = {"account": self.account, "control": self.control} if self.account else {}
        if self.fault_counts:
            extra["fault_counts"] = self.fault_counts
        if self.inquiries is not None:
            extra["discovery"] = [inquiry.as_dict() for inquiry in self.inquiries]
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
    controllers: Sequence[str] = (),
) -> list[Run]:
    """Run combinations of estimator and controller (see `Scenario.combinations`), each with every seed.

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
    controllers
        Names among the scenario's controllers, shipped names or `my_file:MyController`; default those of the scenario.

    Raises
    ------
    PluginError, ScenarioError
        An estimator or controller can not be loaded.
    """
    runs: list[Run] = []
    with located(scenario.path):
        prepared = Prepared.of(scenario, estimators, controllers)
        for seed in dict.fromkeys(seeds or scenario.file.seeds):
            # before it starts, no estimator has touched a run: one fit for all with the same controller (and model)
            initial: dict[tuple[str, bool], dict[str, BatchFit]] = {}
            for controller, name in scenario.combinations(estimators, controllers):
                fitted = initial.setdefault((controller, prepared.shares_fit(name)), {})
                runs.append(run_one(prepared, name, controller, seed, fitted))
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
    estimator, setup = prepared.estimator(estimator_name, seed), prepared.setup(estimator_name, seed)

    def make_prior(steps: list[Step]) -> Prior:
        if "fit" not in initial:
            initial["fit"] = prepared.batch.fit(record_of(scenario, scenario.setup, steps))
        prior = initial["fit"].prior(steps[-1].plant.sample.time)
        if plugin.start == "initial_estimate" and setup.model is scenario.model:
            return prior
        return nominal_start(scenario, setup, steps, prior)

    controller = prepared.controller(controller_name, seed, estimator_name)
    with supervision(prepared, estimator_name, controller_name, seed) as supervise:
        steps = _steps(scenario, seed, setup.model, controller, estimator, len(scenario.starts), make_prior, supervise)
    table = time_series(scenario, steps, setup)
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
        dict(Counter(fault for s in steps for fault in (*s.plant.faults, *s.decision.faults))),
        plans=plan_table(scenario.model, steps),
        inquiries=supervise.inquiries,
    )


def initial_fit(prepared: Prepared, controller_name: str, seed: int) -> BatchFit:
    """Batch fit of the start of a run, before an estimator touches it: to the bit what `run_one` finds."""
    scenario = prepared.scenario

    def never(steps: list[Step]) -> Prior:
        raise AssertionError(f"an estimator started after {len(steps)} of {scenario.initial_rows} intervals")

    untouched = prepared.estimator(next(iter(prepared.estimators)), seed)
    controller = prepared.controller(controller_name, seed)
    steps = _steps(scenario, seed, scenario.model, controller, untouched, scenario.initial_rows, never)
    return prepared.batch.fit(record_of(scenario, scenario.setup, steps))


def _steps(
    scenario: Scenario,
    seed: int,
    model: Model,
    controller: AnyController,
    estimator: AnyEstimator,
    intervals: int,
    make_prior: MakePrior,
    supervise: Supervise = unwatched,
) -> list[Step]:
    """The first intervals of a run with an estimator of that model."""
    scenario.model.check_inputs(scenario.schedule(seed), scenario.starts, where=f"inputs of seed {seed}")
    check_truth(scenario, seed)
    plant, controller = with_faults(scenario, seed, make_plant(scenario, seed, model), controller)
    return run_loop(
        plant,
        estimator,
        controller,
        intervals,
        initial_intervals=scenario.initial_rows,
        make_prior=make_prior,
        supervise=supervise,
    )


def _accounts(scenario: Scenario, table: pd.DataFrame) -> tuple[dict[str, float], dict[str, Any]]:
    if scenario.prices is None or scenario.limits is None:
        return {}, {}
    late = table[table["time_s"] > scenario.fits_after + 1e-9]
    earned = account(
        late, scenario.plant_model, scenario.dt, scenario.prices, scenario.limits.outputs["concentrate_grade"][0]
    )
    return earned, control_account(late)
