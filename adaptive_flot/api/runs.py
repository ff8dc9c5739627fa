"""Run a scenario from Python."""

from __future__ import annotations

import operator
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from adaptive_flot.api.plugins import Choices, plugins
from adaptive_flot.api.progress import counted
from adaptive_flot.api.records import AnyMap, AnyRecord, read_map
from adaptive_flot.api.shown import check_kind, html_of, text_of
from adaptive_flot.errors import ResultError, ScenarioError, near_match
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.data.tables import named
from adaptive_flot.processes.registry import read_measurements
from adaptive_flot.report.kit.wording import seed_list
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_files import run_files, run_summary, write_json, write_runs
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.loop.prepared import controller_plugin, estimator_plugin
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.recorded_inputs import on_record
from adaptive_flot.runner.scenario.scenario import Scenario
from adaptive_flot.targets import check_targets, scenario_inputs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = ("parameters", "outputs", "inputs", "fits")


@dataclass(frozen=True, repr=False)
class Runs:
    """What `run` returns.

    Attributes
    ----------
    scenario
        The scenario.
    runs
        One `Run` for each controller, estimator and seed; `runs[0].table` is its time series.
    """

    scenario: Scenario
    runs: tuple[Run, ...]

    def __len__(self) -> int:
        return len(self.runs)

    @cached_property
    def table(self) -> pd.DataFrame:
        """A row a run: controller, estimator, seed, and the fit [%] of each adapted parameter and driving output.

        Where the scenario has economics, the account follows: recovery, grade and value over the same times. A fit
        whose name is that of an entry of the account is then called `fit_<name>`: the fit of the output `recovery`.
        """
        rows = []
        for r in self.runs:
            fits = {f"fit_{key}" if key in r.account else key: value for key, value in r.fit.items()}
            rows.append({"controller": r.controller, "estimator": r.estimator, "seed": r.seed, **fits, **r.account})
        return pd.DataFrame(rows)

    @cached_property
    def summary(self) -> pd.DataFrame:
        """A row for each controller and estimator: number of seeds, and the median of each column of `table`."""
        groups = self.table.groupby(["controller", "estimator"], sort=False)
        return groups.size().rename("seeds").to_frame().join(groups.median().drop(columns="seed")).reset_index()

    def plot(self, kind: str = "parameters", controller: str | None = None) -> Figure:
        """Draw the runs.

        Parameters
        ----------
        kind
            "parameters", "outputs" or "inputs" over time, of the first seed; "fits" for the fits over five seeds or
            more.
        controller
            Which one's runs; default the first.

        Returns
        -------
        matplotlib.figure.Figure
            A notebook shows it; `figure.savefig("runs.png")` writes it.

        Raises
        ------
        ResultError
            No such kind, no run of that controller, or too few seeds.
        """
        from adaptive_flot.report.kit.distributions import spread_figure
        from adaptive_flot.report.kit.figures import time_figure
        from adaptive_flot.report.run import series

        check_kind(kind, KINDS)
        cases = {case.controller: case for case in series.cases([(self.scenario, self.runs)])}
        name = next(iter(cases)) if controller is None else controller
        if name not in cases:
            raise ResultError(f"plot: no run with the controller {name!r}; {near_match(name, cases)}")
        if kind == "fits":
            spreads = series.spreads(cases[name])
            if not spreads:
                raise ResultError(f"plot: fits are drawn over {series.FEWEST_SEEDS} seeds or more; give more seeds")
            return spread_figure(spreads, cases[name].roles)
        if kind == "inputs":
            return time_figure(series.input_panels(cases[name])[0])
        return time_figure((series.parameter_panels if kind == "parameters" else series.output_panels)(cases[name]))

    def report(self, path: Path | str) -> Path:
        """Write the report as one HTML page, whole or not at all; returns its path.

        Raises
        ------
        OutputError
            The file can not be written.
        """
        from adaptive_flot.report.run.page import write_run_report

        check_targets(scenario_inputs(self.scenario), [("report", Path(path))])
        write_run_report([(self.scenario, self.runs)], path)
        return Path(path)

    def save(self, folder: Path | str) -> Path:
        """Write the time series of each run (CSV) and `summary.json`, which `adaptive-flot compare` reads.

        Raises
        ------
        OutputError
            A file can not be written.
        """
        files = [*run_files(self.runs, Path(folder)), Path(folder) / "summary.json"]
        check_targets(scenario_inputs(self.scenario), [("save", file) for file in files])
        write_runs(self.runs, Path(folder))
        write_json(Path(folder) / "summary.json", run_summary(self.scenario, self.runs))
        return Path(folder)

    def __repr__(self) -> str:
        return text_of(self._title, self.summary)

    def _repr_html_(self) -> str:
        return html_of(self._title, self.summary)

    @property
    def _title(self) -> str:
        seeds = seed_list(dict.fromkeys(r.seed for r in self.runs))
        count = f"{len(self.runs)} {'run' if len(self.runs) == 1 else 'runs'}"
        fits = ", ".join(dict.fromkeys(key for r in self.runs for key in r.fit))
        return f"{self.scenario.name}: {count}, {seeds}; medians over the seeds, fits of {fits} in percent"


def run(
    scenario: Scenario | Path | str,
    *,
    estimators: Choices = (),
    controllers: Choices = (),
    seeds: Iterable[int] = (),
    record: AnyRecord | None = None,
    tag_map: AnyMap | None = None,
    compiled: bool = False,
    progress: bool = False,
) -> Runs:
    """Run a scenario: plant, estimators and controllers together; all of one seed see the same noise.

    Parameters
    ----------
    scenario
        Name of a shipped scenario, a scenario file, or what `load_scenario` returned.
    estimators, controllers
        Default those of the scenario. Each is a name, a class, or (name or class, options). A mapping gives the names
        under which they show: `{"mine": (MyEstimator, {"gain": 0.1})}`.
    seeds
        Seeds of the noise, whole numbers from 0 on; default those of the scenario.
    record
        Measured record whose inputs are played in place of the scenario's, for as long as it lasts. The plant, its
        outputs and its noise stay simulated.
    tag_map
        Map file (or `TagMap`) where `record` is an export of a plant's historian.
    compiled
        Run step and estimators as machine code, by the C compiler of this system.
    progress
        Show a bar in a terminal.

    Returns
    -------
    Runs
        The runs, with the table of their fits.

    Raises
    ------
    ScenarioError
        The scenario can not be used, or a seed is no whole number.
    PluginError
        An estimator or controller can not be loaded.
    DataError, RangeError
        The record can not be used.

    Examples
    --------
    >>> import adaptive_flot as af
    >>> runs = af.run("paper_scenario_1", estimators="fixed", seeds=[1])
    >>> list(runs.table.columns)
    ['controller', 'estimator', 'seed', 'n', 'C', 'concentrate_grade']
    """
    loaded = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
    loaded = loaded if record is None else _on_record(loaded, record, tag_map)
    loaded = loaded.compiled() if compiled else loaded
    chosen = plugins(estimators, lambda name: estimator_plugin(loaded, name), "estimator")
    moved = plugins(controllers, lambda name: controller_plugin(loaded, name), "controller")
    own = {"estimators": {**loaded.file.estimators, **chosen}, "controllers": {**loaded.file.controllers, **moved}}
    extended = replace(loaded, file=loaded.file.model_copy(update=own))
    numbers = _seeds(seeds) or tuple(loaded.file.seeds)
    who = tuple(chosen), tuple(moved)
    count = len(extended.combinations(*who)) * len(numbers)
    with counted(progress, loaded.name, count) as advance:
        return Runs(extended, tuple(run_scenario(extended, who[0], numbers, advance, who[1])))


def _on_record(scenario: Scenario, record: AnyRecord, tag_map: AnyMap | None) -> Scenario:
    if isinstance(record, Dataset):
        return on_record(scenario, record, Path(record.name))
    read = read_measurements(record, scenario.model, tag_map=read_map(tag_map)).record
    return on_record(scenario, read, named(record), Path(tag_map) if isinstance(tag_map, str | Path) else None)


def _seeds(given: Iterable[int]) -> tuple[int, ...]:
    listed: object = given
    if not isinstance(listed, Iterable) or isinstance(listed, str):
        raise ScenarioError(f"seeds: {given!r}; give a list of whole numbers, as range(5)")
    found = []
    for seed in given:
        try:
            found.append(operator.index(seed))
        except TypeError:
            raise ScenarioError(f"seeds: {seed!r} is no whole number; give numbers from 0 on, as range(5)") from None
        if found[-1] < 0:
            raise ScenarioError(f"seeds: {seed} is negative; give whole numbers from 0 on, as range(5)")
    return tuple(dict.fromkeys(found))
