"""Estimate from Python."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from adaptive_flot.api.models import AnyModel, Origin, read_model
from adaptive_flot.api.plugins import Choices, plugins
from adaptive_flot.api.progress import staged
from adaptive_flot.api.records import AnyMap, AnyRecord, read_map, record_files, record_name
from adaptive_flot.api.shown import check_kind, html_of, text_of
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import Model
from adaptive_flot.plugins import OF_A_RECORD
from adaptive_flot.processes.registry import find_cell
from adaptive_flot.runner.commands.estimate import RecordEstimate, estimate_record, shipped_plugin
from adaptive_flot.runner.commands.estimate_files import save_fitted_cell
from adaptive_flot.runner.commands.record_blocks import cut, read_blocks
from adaptive_flot.targets import check_targets

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = ("outputs", "parameters", "inputs")


@dataclass(frozen=True, repr=False)
class Estimation:
    """What `estimate` returns.

    Attributes
    ----------
    result
        Everything behind it: the two blocks of the record, the batch fit, and each estimator's replay.
    origin
        Where the model came from.
    sources
        Files of the record and of the model: no result is written over them.
    """

    result: RecordEstimate
    origin: Origin
    sources: tuple[Path, ...] = ()

    @cached_property
    def table(self) -> pd.DataFrame:
        """Root mean square errors: a row for each estimator, block and measured output.

        Columns `one_step` (predictions one sample ahead) and `free_run` (simulation with the parameters held) are in
        `unit`; `ljung_box_p` is small where the innovations are not white; `samples` counts measurements.
        """
        rows = [{"estimator": r.estimator, **asdict(error)} for r in self.result.replays for error in r.errors]
        return pd.DataFrame(rows)

    @cached_property
    def parameters(self) -> pd.DataFrame:
        """Batch fit of the first block: a row a parameter, with its standard deviation and what the record tells."""
        judged = [verdict for _, _, verdict in self.result.batch.identifiability.parameters]
        rows = [asdict(e) for e in self.result.batch.estimates]
        return pd.DataFrame(rows).drop(columns="at_bound").assign(judged=judged)

    @cached_property
    def series(self) -> dict[str, pd.DataFrame]:
        """Time series of each estimator by its name: measured, predicted, innovation, free run, estimates, status."""
        return {replay.estimator: replay.table for replay in self.result.replays}

    @property
    def model(self) -> Model:
        """The model with the parameters of the batch fit."""
        fitted = {e.name: e.value for e in self.result.batch.estimates}
        return self.result.setup.model.with_parameters(fitted)

    @property
    def smoothed(self) -> pd.DataFrame | None:
        """States and parameters given the whole record, with standard deviations; None without the innovations form."""
        return None if self.result.innovations is None else self.result.innovations.table

    def plot(self, kind: str = "outputs") -> Figure:
        """Draw the record.

        Parameters
        ----------
        kind
            "outputs" of the test block with the predictions, "parameters" over time, or "inputs".

        Returns
        -------
        matplotlib.figure.Figure
            A notebook shows it; `figure.savefig("fit.png")` writes it.

        Raises
        ------
        ResultError
            No such kind.
        """
        from adaptive_flot.report.estimate import series
        from adaptive_flot.report.kit.figures import time_figure

        check_kind(kind, KINDS)
        if kind == "outputs":
            measured = series.measured_outputs(self.result)
            return time_figure([p for q in measured for p in series.output_panels(self.result, q, "test")])
        return time_figure((series.input_panels if kind == "inputs" else series.parameter_panels)(self.result))

    def report(self, path: Path | str) -> Path:
        """Write the report as one HTML page, whole or not at all; returns its path.

        Raises
        ------
        OutputError
            The file can not be written.
        """
        from adaptive_flot.report.estimate.page import write_estimate_report

        check_targets(self.sources, [("report", Path(path))])
        write_estimate_report(self.result, path, read=self.sources)
        return Path(path)

    def save(self, path: Path | str, *, base: str | None = None) -> Path:
        """Write the fitted model as a model file (YAML); every function that takes a model accepts it.

        Parameters
        ----------
        path
            File to write, `.yaml`.
        base
            Address of the function that makes the process, "my_file:make_model"; needed where a `Model` of one's own
            was given.

        Raises
        ------
        ModelError
            The process is not known, or the name does not end in .yaml.
        OutputError
            The file can not be written.
        """
        check_targets(self.sources, [("save", Path(path))])
        return self.origin.save(self.model, path, f"calibrated on {self.result.blocks.name}", base)

    def save_cell(self, path: Path | str) -> Path:
        """Write the fitted parameters as a cell file (YAML); of the flotation cell only.

        Raises
        ------
        ModelError
            The model is no flotation cell.
        OutputError
            The file can not be written.
        """
        if self.origin.base != "flotation":
            raise ModelError(f"{path}: model {self.result.setup.model.name!r} has no cell file; use save")
        check_targets(self.sources, [("save_cell", Path(path))])
        save_fitted_cell(self.result, find_cell(self.origin.cell), Path(path))
        return Path(path)

    def __repr__(self) -> str:
        return "\n".join((text_of(self._title, self._test_errors), text_of("batch fit", self._fit)))

    def _repr_html_(self) -> str:
        return html_of(self._title, self._test_errors) + html_of("batch fit", self._fit)

    @property
    def _title(self) -> str:
        blocks = self.result.blocks
        rows = f"{len(blocks.fit)} rows to fit on, {blocks.tested} to test on"
        return f"{blocks.name}: {rows}; errors on the test block"

    @property
    def _test_errors(self) -> pd.DataFrame:
        return self.table[self.table["block"] == "test"].drop(columns=["block", "samples"])

    @property
    def _fit(self) -> pd.DataFrame:
        return self.parameters[["label", "value", "std", "unit", "judged"]]


def estimate(
    model: AnyModel,
    data: AnyRecord,
    *,
    estimators: Choices = OF_A_RECORD,
    parameters: Sequence[str] = (),
    outputs: Sequence[str] = (),
    fit_share: float = 0.6,
    innovations: bool | None = None,
    tag_map: AnyMap | None = None,
    compiled: bool = False,
    progress: bool = False,
) -> Estimation:
    """Fit a model to the first part of a measured record, then replay all of it through estimators.

    Parameters
    ----------
    model
        A `Model`, the name of a process or cell, a YAML file, or "my_file:make_model".
    data
        CSV or Parquet file, a DataFrame, or what `read_dataset` returned.
    estimators
        Names ("pem" is the batch fit held fixed), classes, or (name or class, options); default "fixed", "adaptive_imm"
        and "pem". "fixed" starts with the nominal parameters, all others with those of the batch fit.
    parameters
        Names of the parameters to estimate; default those with the role "estimated".
    outputs
        Name, or names, of the outputs that drive the estimation; default all that are measured.
    fit_share
        Part of the record to fit on, from its beginning: a number between 0 and 1.
    innovations
        Whether to estimate in innovations form as well, with process noise; None where the record asks for it.
    tag_map
        Map file (or `TagMap`) of an export: from its tags to the model's quantities.
    compiled
        Run step and estimators as machine code, by the C compiler of this system.
    progress
        Show the stages in a terminal.

    Returns
    -------
    Estimation
        Errors, fitted parameters and time series.

    Raises
    ------
    DataError, RangeError
        The record can not be used.
    ModelError, CellError
        The model can not be used, or a name is none of its own.
    PluginError
        An estimator can not be loaded.

    Examples
    --------
    >>> import adaptive_flot as af
    >>> inputs = pd.DataFrame({"time_s": range(0, 1200, 10), "air_flow_m3_s": 1.2e-3, "level_setpoint_m": 0.4})
    >>> inputs["feed_flow_m3_s"] = [1.7e-4 if time % 400 < 200 else 2.0e-4 for time in inputs["time_s"]]
    >>> record = af.simulate("lab_87l", inputs).table
    >>> fit = af.estimate("lab_87l", record, estimators=["fixed"], parameters=["C"], outputs=["concentrate_grade"])
    >>> fit.parameters["label"].tolist()
    ['C']
    """
    made, origin = read_model(model)
    sources = (*record_files(data, tag_map), *origin.files)
    made = replace(made, compiled=compiled)
    parameters, outputs = ([given] if isinstance(given, str) else given for given in (parameters, outputs))
    chosen = plugins(estimators, shipped_plugin, "estimator")
    if not 0.0 < fit_share < 1.0:
        raise ModelError(f"fit_share = {fit_share:g}; give a number between 0 and 1, as 0.6")
    if isinstance(data, Dataset):
        blocks = cut(data, fit_share, data.name)
    else:
        blocks = read_blocks(data, made, fit_share, read_map(tag_map))
    with staged(progress, record_name(data)) as advance:
        result = estimate_record(
            blocks, made, estimators=chosen, fit=parameters, outputs=outputs, folder=Path.cwd(),
            innovations=innovations, progress=advance,
        )  # fmt: skip
    return Estimation(result, origin, sources)
