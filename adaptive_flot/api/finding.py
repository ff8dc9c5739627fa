"""Discover from Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, overload

import pandas as pd

from adaptive_flot.api.changes import Change
from adaptive_flot.api.models import AnyModel, Origin, read_model
from adaptive_flot.api.progress import staged
from adaptive_flot.api.records import AnyMap, AnyRecord, SeveralRecords, read_map, record_files, record_name
from adaptive_flot.api.shown import check_kind, error_table, html_of, text_of
from adaptive_flot.discovery.discover import discover as search_record
from adaptive_flot.discovery.results import Discovery, Verdict
from adaptive_flot.discovery.verdict.words.curve import EffectCurve, effect_curves
from adaptive_flot.errors import DataError, ModelError, ResultError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import Model
from adaptive_flot.parallel import available_processes
from adaptive_flot.runner.commands.discover import discover_file
from adaptive_flot.runner.commands.discover_records import discover_records
from adaptive_flot.targets import check_targets

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class Finding:
    """What `discover` returns.

    Attributes
    ----------
    name
        What the record is called.
    discovery
        Everything behind the verdict: data checks, search, alternatives, fits.
    origin
        Where the model came from.
    sources
        Files of the record and of the model: no result is written over them.
    """

    name: str
    discovery: Discovery
    origin: Origin
    sources: tuple[Path, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """What the record says: `word`, `reason`, `effects`, `error`, `experiment`, and `as_dict()`."""
        return self.discovery.verdict

    @property
    def model(self) -> Model:
        """The model with the effect that was named (or the curve without a name), fitted; else the plain fitted one."""
        return self.discovery.model

    @cached_property
    def table(self) -> pd.DataFrame:
        """Free-run root mean square error of each output, before and after, on rows that neither fitted nor chose."""
        return error_table(self.verdict, "noise")

    @cached_property
    def effects(self) -> pd.DataFrame:
        """Coefficients of the effects that the verdict tells: a row a coefficient, with its 95 % interval."""
        rows = []
        for named in self.verdict.effects:
            units = self.model.effect_units(named.effect)
            place = {"site": named.effect.site, "driver": named.effect.driver, "form": named.effect.form}
            for key, value in named.effect.coefficients.items():
                low, high = named.interval95.get(key, (float("nan"), float("nan")))
                rows.append({**place, "coefficient": key, "value": value, "low": low, "high": high, "unit": units[key]})
        return pd.DataFrame(rows)

    @property
    def kinds(self) -> tuple[str, ...]:
        """What `plot` can draw of this finding, the most telling first."""
        d = self.discovery
        if d.search is None or d.problem is None or d.before is None or d.after is None:
            return ()
        return (*(("effect",) if self._curves else ()), "residual", "map")

    def plot(self, kind: str | None = None) -> Figure:
        """Draw the finding.

        Parameters
        ----------
        kind
            "effect": the curve of each effect over its driver, with its 95 % band. "residual": measured minus free run
            over time, before and after. "map": what each site with each driver would explain. Default the first of
            these that there is (see `kinds`).

        Returns
        -------
        matplotlib.figure.Figure
            A notebook shows it; `figure.savefig("finding.png")` writes it.

        Raises
        ------
        ResultError
            No such kind, or nothing was searched.
        """
        from adaptive_flot.report.discovery.figures import curve_figure, heat_map, residual_panels
        from adaptive_flot.report.kit.figures import time_figure

        d = self.discovery
        if d.search is None or d.problem is None or d.before is None or d.after is None:
            raise ResultError(f"plot: nothing was searched in {self.name}: {self.verdict.reason}")
        kind = self.kinds[0] if kind is None else kind
        check_kind(kind, self.kinds)
        if kind == "effect":
            return curve_figure(self._curves)
        if kind == "residual":
            return time_figure(residual_panels(d.problem, d.before, d.after))
        best = d.judgement.best if d.judgement else None
        return heat_map(d.search.rounds[0].scores, best.names if best else ())

    def report(self, path: Path | str) -> Path:
        """Write the report as one HTML page, whole or not at all; returns its path.

        Raises
        ------
        OutputError
            The file can not be written.
        """
        from adaptive_flot.report.discovery.page import write_discovery_report

        check_targets(self.sources, [("report", Path(path))])
        write_discovery_report(self.discovery, Path(self.name).stem, path, read=self.sources)
        return Path(path)

    def save(self, path: Path | str, *, base: str | None = None) -> Path:
        """Write the extended model as a model file (YAML); every function that takes a model accepts it.

        Parameters
        ----------
        path
            File to write, `.yaml`.
        base
            Address of the function that makes the process, "my_file:make_model"; needed where a `Model` of one's own
            was given.

        Raises
        ------
        ResultError
            Nothing was fitted.
        ModelError
            The process is not known, or the name does not end in .yaml.
        OutputError
            The file can not be written.
        """
        if self.discovery.before is None:
            raise ResultError(f"{path}: nothing was fitted, so there is no model to write: {self.verdict.reason}")
        check_targets(self.sources, [("save", Path(path))])
        return self.origin.save(self.model, path, f"discovered in {self.name}: {self.verdict.word}", base)

    def __repr__(self) -> str:
        return text_of(self._title, self.table)

    def _repr_html_(self) -> str:
        return html_of(self._title, self.table)

    @property
    def _title(self) -> str:
        return f"{self.name}: {self.verdict.word}. {self.verdict.reason}"

    @cached_property
    def _curves(self) -> tuple[EffectCurve, ...]:
        d = self.discovery
        if d.problem is None or d.after is None or d.judgement is None or d.judgement.best is None:
            return ()
        return effect_curves(d.problem, d.told or d.after, len(d.judgement.best.names))


@overload
def discover(
    model: AnyModel,
    data: AnyRecord,
    *,
    limits: Mapping[str, tuple[float, float]] | None = None,
    tag_map: AnyMap | None = None,
    processes: int | None = None,
    budget: float | None = None,
    progress: bool = False,
) -> Finding: ...


@overload
def discover(
    model: AnyModel,
    data: AnyRecord,
    *,
    references: Sequence[AnyRecord],
    tag_map: AnyMap | None = None,
    processes: int | None = None,
    budget: float | None = None,
    progress: bool = False,
) -> Change: ...


@overload
def discover(
    model: AnyModel,
    data: SeveralRecords,
    *,
    references: Sequence[AnyRecord] = (),
    tag_map: AnyMap | None = None,
    processes: int | None = None,
    progress: bool = False,
) -> Change: ...


def discover(
    model: AnyModel,
    data: AnyRecord | SeveralRecords,
    *,
    references: Sequence[AnyRecord] = (),
    limits: Mapping[str, tuple[float, float]] | None = None,
    tag_map: AnyMap | None = None,
    processes: int | None = None,
    budget: float | None = None,
    compiled: bool = True,
    progress: bool = False,
) -> Finding | Change:
    """Find what physical effect a model lacks, from a measured record; or what has changed since a reference.

    Parameters
    ----------
    model
        A `Model` with sites, the name of a process or cell, a YAML file, or "my_file:make_model".
    data
        CSV or Parquet file, a DataFrame, or what `read_dataset` returned; or several of one process.
    references
        Records on which the model was right: constants and usual errors come from them.
    limits
        Lowest and highest value of inputs by name, in the input's unit, for the test that is proposed. Default: the
        test stays where the record has been.
    tag_map
        Map file (or `TagMap`) of exports: from their tags to the model's quantities.
    processes
        Fits that run at once; default as many as there are cores.
    budget
        Seconds after which the search ends with what it has come to. With references or several records nothing is
        named where it ends before all simple hypotheses are compared.
    compiled
        Whether long runs are machine code, where this system has a C compiler. The numbers agree to rounding.
    progress
        Show the stages in a terminal.

    Returns
    -------
    Finding or Change
        The verdict, the extended model, and the error before and after: a `Change` with several records or references.

    Raises
    ------
    DataError, RangeError
        A record can not be used.
    ModelError, CellError, PluginError
        The model can not be used, or it has no sites; limits with several records.
    """
    records: list[AnyRecord] = list(data) if isinstance(data, (list, tuple)) else [data]
    if not records:
        raise DataError("discover: no record; give at least one")
    if budget is not None and not budget >= 1.0:
        raise ModelError(f"budget = {budget:g} s; give at least 1, or None for as long as it takes")
    name, workers = ", ".join(record_name(r) for r in records), processes or available_processes()
    several = len(records) > 1 or bool(references)
    if several and limits:
        raise ModelError("limits: no test is proposed with a reference or for several records; leave them out")
    made, origin = read_model(model)
    made = replace(made, record_code=compiled)
    sources = (*(file for r in (*records, *references) for file in record_files(r, tag_map)), *origin.files)
    tags = read_map(tag_map)
    with staged(progress, name) as advance:
        if several:
            compared = discover_records(
                records, made, list(references), tag_map=tags, processes=workers, progress=advance, budget=budget
            )
            return Change(name, compared, origin, sources)
        one = records[0]
        if isinstance(one, Dataset):
            searched = search_record(made, one, limits=limits, processes=workers, budget=budget, progress=advance)
        else:
            searched = discover_file(
                one, made, limits=limits, tag_map=tags, processes=workers, budget=budget, progress=advance
            )
    return Finding(name, searched, origin, sources)
