"""Replay a measured record through estimators: one-step and free-run errors, innovations, whiteness."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from adaptive_flot import metrics
from adaptive_flot.contracts import AnyEstimator, ControllerSetup, Prior, Setup, full_parameters
from adaptive_flot.contracts.batch import BatchFit
from adaptive_flot.contracts.track import Track
from adaptive_flot.described import Described
from adaptive_flot.errors import DataError, ModelError, PluginError, near_match
from adaptive_flot.greybox.data.dataset import Dataset, read_dataset
from adaptive_flot.greybox.data.tables import Source, named
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.record import RecordSimulator
from adaptive_flot.plugins import BATCH_ESTIMATORS, CONTROLLERS, ESTIMATORS, construct, load
from adaptive_flot.processes.cascaded_tanks import read_benchmark
from adaptive_flot.runner.loop.loop import run_loop
from adaptive_flot.runner.plants.plant import ReplayPlant
from adaptive_flot.runner.scenario.keys import Plugin

WHITENESS_LAGS = 20


@dataclass(frozen=True, repr=False)
class Blocks(Described):
    """A record in two blocks: `fit` (parameters come from here only) and `test`.

    `continues` tells whether the test block goes on where the fit block ends, or starts from the same initial state.
    """

    name: str
    fit: Dataset
    test: Dataset
    continues: bool

    def described(self) -> dict[str, object]:
        """The record and its cut; see `Described`."""
        return {"record": self.name, "rows to fit": len(self.fit), "rows to test": len(self.test)}


@dataclass(frozen=True)
class OutputError:
    """Errors of one output in one block.

    Attributes
    ----------
    block, output, unit
        Which.
    one_step, free_run
        Root mean square error [unit]: of the estimator's predictions one sample ahead, and of a simulation with the
        parameters it had at the end of the fit block held.
    ljung_box_p
        p value of the Ljung-Box test of the innovations over 20 lags; small: not white, something is left.
    samples
        Number of measurements.
    """

    block: str
    output: str
    unit: str
    one_step: float
    free_run: float
    ljung_box_p: float
    samples: int


@dataclass(frozen=True, repr=False)
class Replay(Described):
    """One estimator over the record.

    Attributes
    ----------
    estimator
        Its name.
    parameters
        Label to (value, standard deviation) at the end of the fit block.
    errors
        For each block and measured output.
    table
        Time series: block, time, inputs, and for each output `_measured`, `_predicted`, `_innovation`, `_free_run`; for
        each parameter `_estimate`, `_std`; `status`.
    status_counts
        How often which status was returned.
    """

    estimator: str
    parameters: dict[str, tuple[float, float]]
    errors: tuple[OutputError, ...]
    table: pd.DataFrame
    status_counts: dict[str, int]

    def described(self) -> dict[str, object]:
        """Who, and the parameters at the end of the fit block; see `Described`."""
        return {"estimator": self.estimator, **{k: f"{v:.4g} ± {s:.2g}" for k, (v, s) in self.parameters.items()}}


@dataclass(frozen=True, repr=False)
class RecordEstimate(Described):
    """Result of `estimate`: the blocks, the batch fit of the fit block and the replays."""

    blocks: Blocks
    setup: Setup
    batch: BatchFit
    replays: tuple[Replay, ...]

    def described(self) -> dict[str, object]:
        """Record, batch fit and estimators; see `Described`."""
        fitted = {e.label: f"{e.value:.4g} ± {e.std:.2g} {e.unit}" for e in self.batch.estimates}
        return {"record": self.blocks.name, **fitted, "estimators": ", ".join(r.estimator for r in self.replays)}


def read_blocks(path: Source, model: Model, fit_share: float) -> Blocks:
    """Read a record and cut it into fit and test block.

    The cascaded-tanks benchmark brings its two records; any other table is cut in time at `fit_share`.

    Raises
    ------
    DataError, RangeError
        The table can not be used.
    """
    if model.name == "cascaded-tanks":
        estimation, validation = read_benchmark(path)
        return Blocks(estimation.name.partition(":")[0], estimation, validation, continues=False)
    return cut(read_dataset(path, model, required_outputs=(model.outputs[0].name,)), fit_share, str(named(path)))


def cut(record: Dataset, fit_share: float, where: str) -> Blocks:
    """Cut a record in time into fit and test block; `where` is what messages call it.

    Raises
    ------
    DataError
        A block would hold fewer than two rows.
    """
    rows = round(fit_share * len(record))
    if not 2 <= rows <= len(record) - 2:
        raise DataError(f"{where}: {len(record)} rows can not be cut at {fit_share:g}; give a longer record")
    # the test block starts at the last row of the fit block: that is its initial instant
    return Blocks(record.name, record.rows(0, rows), record.rows(rows - 1), continues=True)


def estimate_record(
    blocks: Blocks,
    model: Model,
    *,
    estimators: Sequence[str] | Mapping[str, Plugin] = ("fixed", "rpem", "pem"),
    fit: Sequence[str] = (),
    outputs: Sequence[str] = (),
    folder: Path | None = None,
    progress: Callable[[], None] = lambda: None,
) -> RecordEstimate:
    """Fit the fit block, then replay both blocks through each estimator.

    Parameters
    ----------
    blocks
        The record, from `read_blocks`.
    model
        The model; its parameter values are the nominal ones.
    estimators
        Shipped names, `pem` for the batch fit held fixed, or `my_file:MyEstimator`; or plug-ins by the name to show.
        All start at the fitted initial state: `fixed` with the nominal parameters, the others with the batch fit of
        the fit block.
    fit
        Parameters to estimate; default those with the role "estimated".
    outputs
        Outputs that drive the estimation; default all that are measured.
    folder
        Folder of a user's own estimator file.
    progress
        Called after the batch fit and after each estimator.

    Raises
    ------
    DataError, ModelError, PluginError
        Nothing measured, unknown names, an estimator that can not be loaded, or one that needs the truth.
    """
    names = model.expand_parameters(fit) if fit else tuple(p.name for p in model.parameters if p.role == "estimated")
    if not names:
        raise ModelError(f"model '{model.name}' has no parameter with the role 'estimated'; name them with --fit")
    plugins = dict(estimators) if isinstance(estimators, Mapping) else {n: shipped_plugin(n) for n in estimators}
    for name, plugin in plugins.items():
        if plugin.use not in BATCH_ESTIMATORS and plugin.needs_truth(folder):
            raise PluginError(f"estimator {name!r} is shown the true parameters, which no record holds; leave it out")
    driving = tuple(outputs) or blocks.fit.measured(model)
    model.indices("outputs", driving)
    unmeasured = [o for o in driving if o not in blocks.fit.measured(model)]
    if unmeasured or not driving:
        raise DataError(f"{blocks.name}: output {(unmeasured or ['any'])[0]!r} is not measured in the record; add it")
    setup = Setup(model, blocks.fit.dt, names, driving)
    factory = load("pem", BATCH_ESTIMATORS, "batch estimator")
    batch: BatchFit = construct(factory, "pem", "batch estimator", setup, initial_state="estimated").fit(blocks.fit)
    progress()
    replays = []
    for name, plugin in plugins.items():
        replays.append(_replay(name, plugin, setup, blocks, batch, folder))
        progress()
    return RecordEstimate(blocks, setup, batch, tuple(replays))


def shipped_plugin(name: str) -> Plugin:
    """Plug-in behind a shipped name, `pem`, or `my_file:MyEstimator`.

    Raises
    ------
    PluginError
        None of these; the message holds the nearest name.
    """
    known = {**ESTIMATORS, **BATCH_ESTIMATORS}
    if name not in known and ":" not in name:
        raise PluginError(f"unknown estimator {name!r}; {near_match(name, known)}")
    return Plugin(use=name)


def _replay(name: str, plugin: Plugin, setup: Setup, blocks: Blocks, batch: BatchFit, folder: Path | None) -> Replay:
    held = plugin.use in BATCH_ESTIMATORS
    estimator = (Plugin(use="fixed") if held else plugin).make(setup, ESTIMATORS, "estimator", folder)
    prior = _start(plugin.use, setup, blocks, batch)

    first = _run(blocks.fit, estimator, setup, prior)
    end = first.end(prior.noise_std)
    x_test = end.state if blocks.continues else batch.initial_state
    second = _run(blocks.test, estimator, setup, replace(end, time=float(blocks.test.time[0]), state=x_test))

    simulator = RecordSimulator(setup.model, setup.dt)
    p = full_parameters(setup.model, setup.parameters, end.parameters)
    free_fit = simulator.outputs(blocks.fit, batch.initial_state, p)
    x_free = simulator.last_state(blocks.fit, batch.initial_state, p) if blocks.continues else batch.initial_state
    free_test = simulator.outputs(blocks.test, x_free, p)

    known = batch.covariance if held else None  # held parameters keep what the fit knew of them
    tables = [
        _table("fit", setup, blocks.fit, first, free_fit, known),
        _table("test", setup, blocks.test, second, free_test, known).iloc[1 if blocks.continues else 0 :],
    ]
    labels = [setup.model.parameters[i].label for i in setup.model.indices("parameters", setup.parameters)]
    std = np.sqrt(np.diag(end.covariance if known is None else known))
    return Replay(
        estimator=name,
        parameters={k: (float(v), float(s)) for k, v, s in zip(labels, end.parameters, std, strict=True)},
        errors=tuple(e for t in tables for e in _errors(setup, t)),
        table=pd.concat(tables, ignore_index=True),
        status_counts=dict(Counter(status.name.lower() for status in (*first.statuses, *second.statuses))),
    )


def _start(use: str, setup: Setup, blocks: Blocks, batch: BatchFit) -> Prior:
    """`fixed` holds the nominal parameters; the others start from the batch fit, as the paper's RPEM does."""
    values = batch.values()
    if use == "fixed":
        values = setup.model.parameter_values[setup.model.indices("parameters", setup.parameters)]
    return Prior(float(blocks.fit.time[0]), batch.initial_state, values, batch.covariance, batch.noise_std)


def _run(record: Dataset, estimator: AnyEstimator, setup: Setup, prior: Prior) -> Track:
    """Replay rows 1, 2, ... of a record: at once where the estimator can, else by the runner's loop."""
    whole: Callable[..., Track] | None = getattr(estimator, "track", None)
    if whole is not None:
        return whole(estimator.init(prior), record.time[1:], record.inputs[1:], record.outputs[1:])
    controller = load("schedule", CONTROLLERS, "controller")(ControllerSetup(setup.model, setup.dt, record.inputs[1:]))
    plant = ReplayPlant(record, len(setup.model.parameters))
    steps = run_loop(plant, estimator, controller, len(record) - 1, initial_intervals=0, make_prior=lambda _: prior)
    return Track.of([s.estimate for s in steps if s.estimate is not None])


def _table(
    block: str, setup: Setup, record: Dataset, track: Track, free: FloatArray, known: FloatArray | None
) -> pd.DataFrame:
    model = setup.model
    predicted = np.vstack([free[0], track.prediction])  # row 0 is the initial instant
    columns: dict[str, object] = {"block": [block] * len(record), "time_s": record.time}
    columns |= {q.column: record.inputs[:, j] for j, q in enumerate(model.inputs)}
    for j, q in enumerate(model.outputs):
        if np.isfinite(record.outputs[:, j]).any():
            columns[f"{q.column}_measured"] = record.outputs[:, j]
            columns[f"{q.column}_predicted"] = predicted[:, j]
            columns[f"{q.column}_innovation"] = record.outputs[:, j] - predicted[:, j]
            columns[f"{q.column}_free_run"] = free[:, j]
    theta = np.vstack([track.parameters[:1], track.parameters])
    covariance = np.concatenate([track.covariance[:1], track.covariance])
    variances = np.diagonal(covariance if known is None else np.tile(known, (len(theta), 1, 1)), axis1=1, axis2=2)
    std = np.sqrt(variances)
    for j, i in enumerate(model.indices("parameters", setup.parameters)):
        columns[f"{model.parameters[i].label}_estimate"] = theta[:, j]
        columns[f"{model.parameters[i].label}_std"] = std[:, j]
    columns["status"] = [s.name.lower() for s in (track.statuses[0], *track.statuses)]
    return pd.DataFrame(columns)


def _errors(setup: Setup, table: pd.DataFrame) -> list[OutputError]:
    found = []
    for q in setup.model.outputs:
        if f"{q.column}_measured" not in table:
            continue
        innovation = table[f"{q.column}_innovation"].to_numpy(dtype=float)
        free = (table[f"{q.column}_measured"] - table[f"{q.column}_free_run"]).to_numpy(dtype=float)
        found.append(
            OutputError(
                block=str(table["block"].iloc[0]),
                output=q.name,
                unit=q.unit,
                one_step=metrics.rmse(innovation),
                free_run=metrics.rmse(free),
                ljung_box_p=ljung_box_p(innovation),
                samples=int(np.isfinite(innovation).sum()),
            )
        )
    return found


def ljung_box_p(innovation: FloatArray, lags: int = WHITENESS_LAGS) -> float:
    """Return the p value of the Ljung-Box test over `lags` lags (statsmodels); NaN for too short or constant a series.

    Missing samples are left out, which is exact for the white series that the test supposes.
    """
    from statsmodels.stats.diagnostic import acorr_ljungbox

    finite = innovation[np.isfinite(innovation)]
    if len(finite) <= 2 * lags or np.ptp(finite) == 0:
        return float("nan")
    return float(acorr_ljungbox(finite, lags=[lags])["lb_pvalue"].iloc[0])
