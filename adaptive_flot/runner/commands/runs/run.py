"""Run a scenario for several estimators, controllers and seeds; all of one seed see the same noise and inputs."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from adaptive_flot.contracts import AnyController, AnyEstimator, Prior
from adaptive_flot.contracts.batch import BatchFit
from adaptive_flot.errors import located
from adaptive_flot.greybox.model import Model
from adaptive_flot.runner.adaptation.supervision import supervision
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.commands.runs.side_by_side import can_go_side_by_side, run_side_by_side
from adaptive_flot.runner.loop.loop import MakePrior, Step, Supervise, run_loop, unwatched
from adaptive_flot.runner.loop.prepared import Prepared
from adaptive_flot.runner.loop.starts import prior_of, record_of
from adaptive_flot.runner.plants.fault_injection import with_controller_faults, with_plant_faults
from adaptive_flot.runner.plants.scenario_plant import make_plant
from adaptive_flot.runner.results.run_arrays import RunArrays
from adaptive_flot.runner.scenario.checks import check_realisation
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario

Progress = Callable[[], None]
AT_ONCE = 64
"""Most seeds of a combination that run side by side: their plants alone take a megabyte each."""


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
        every = list(dict.fromkeys(seeds or scenario.file.seeds))
        combinations = scenario.combinations(estimators, controllers)
        first = Realisation(scenario, every[0])
        together = {c for c in combinations if can_go_side_by_side(prepared, c[1], c[0], first)}
        for group in (every[i : i + AT_ONCE] for i in range(0, len(every), AT_ONCE)):
            realisations = [Realisation(scenario, seed) for seed in group]
            # before it starts, no estimator has touched a run: one fit for all with the same controller (and model);
            # plants side by side are the same as others to rounding only, so they have their own
            initial: dict[tuple[str, bool, bool], list[dict[str, BatchFit]]] = {}
            found: dict[tuple[str, str], list[Run | Exception]] = {}
            for i, realisation in enumerate(realisations):
                for controller, name in combinations:
                    key = (controller, prepared.shares_fit(name), (controller, name) in together)
                    fitted = initial.setdefault(key, [{} for _ in group])
                    if (controller, name) in together:
                        if not i:
                            found[controller, name] = run_side_by_side(prepared, name, controller, realisations, fitted)
                        run = found[controller, name][i]
                    else:
                        run = run_one(prepared, name, controller, realisation, fitted[i])
                    if isinstance(run, Exception):
                        raise run
                    runs.append(run)
                    progress()
    return runs


def run_one(
    prepared: Prepared,
    estimator_name: str,
    controller_name: str,
    realisation: Realisation,
    initial: dict[str, BatchFit],
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
    scenario = prepared.scenario
    setup = prepared.setup(estimator_name, realisation)

    def make_prior(steps: list[Step]) -> Prior:
        if "fit" not in initial:
            initial["fit"] = prepared.batch.fit(record_of(scenario, scenario.setup, steps))
        return prior_of(prepared, estimator_name, setup, record_of(scenario, setup, steps), initial["fit"])

    estimator = prepared.estimator(estimator_name, realisation)
    controller = prepared.controller(controller_name, realisation, setup)
    with supervision(prepared, estimator_name, controller_name, realisation) as supervise:
        steps = _steps(realisation, setup.model, controller, estimator, make_prior, supervise)
    arrays = RunArrays.of(steps, setup)
    run = Run.of(estimator_name, controller_name, realisation, arrays, setup, initial["fit"], supervise.inquiries)
    return replace(run, seconds=round(time.perf_counter() - begin, 4))


def initial_fit(prepared: Prepared, controller_name: str, realisation: Realisation) -> BatchFit:
    """Batch fit of the start of a run, before an estimator touches it: to the bit what `run_one` finds."""
    scenario = prepared.scenario

    def never(steps: list[Step]) -> Prior:
        raise AssertionError(f"an estimator started after {len(steps)} of {scenario.initial_rows} intervals")

    untouched = prepared.estimator(next(iter(prepared.estimators)), realisation)
    controller = prepared.controller(controller_name, realisation, scenario.setup)
    steps = _steps(realisation, scenario.model, controller, untouched, never, intervals=scenario.initial_rows)
    return prepared.batch.fit(record_of(scenario, scenario.setup, steps))


def _steps(
    realisation: Realisation,
    model: Model,
    controller: AnyController,
    estimator: AnyEstimator,
    make_prior: MakePrior,
    supervise: Supervise = unwatched,
    intervals: int | None = None,
) -> list[Step]:
    """The first intervals of a run, default all, with an estimator of that model."""
    scenario = realisation.scenario
    check_realisation(realisation)
    return run_loop(
        with_plant_faults(realisation, make_plant(realisation, model)),
        estimator,
        with_controller_faults(scenario, controller),
        len(scenario.starts) if intervals is None else intervals,
        initial_intervals=scenario.initial_rows,
        make_prior=make_prior,
        supervise=supervise,
    )
