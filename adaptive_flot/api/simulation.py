"""Simulate from Python."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from adaptive_flot.api.models import AnyModel, read_model
from adaptive_flot.api.records import AnyRecord, record_files, record_name
from adaptive_flot.api.shown import html_of, text_of
from adaptive_flot.errors import ResultError, near_match
from adaptive_flot.greybox.data.dataset import TIME_COLUMN, Dataset, read_dataset
from adaptive_flot.greybox.data.tables import write_table
from adaptive_flot.greybox.model import Model, Quantity
from adaptive_flot.runner.commands.simulate import MEASURED, simulate_record
from adaptive_flot.targets import check_targets

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ENDS = 3
"""Rows shown at each end of a table."""


@dataclass(frozen=True, repr=False)
class Simulation:
    """What `simulate` returns.

    Attributes
    ----------
    name
        What the table of inputs is called.
    model
        The model.
    table
        `time_s`, inputs, parameters that move, outputs, signals and states: a row an instant, units in the names.
    sources
        Files of the record and of the model: no result is written over them.
    """

    name: str
    model: Model
    table: pd.DataFrame
    sources: tuple[Path, ...] = ()

    def plot(self, columns: Sequence[str] = ()) -> Figure:
        """Draw columns over time.

        Parameters
        ----------
        columns
            Columns of `table`, or names of inputs, outputs, signals and states; default the inputs that move and all
            outputs.

        Returns
        -------
        matplotlib.figure.Figure
            A notebook shows it; `figure.savefig("simulation.png")` writes it.

        Raises
        ------
        ResultError
            No such column.
        """
        from adaptive_flot.charts.plotdata import Panel, Role, Trace
        from adaptive_flot.report.kit.figures import time_figure

        inputs = {q.column for q in self.model.inputs}
        known = {q.column: q for q in self._quantities if q.column in self.table}
        by_name = {q.name: q.column for q in known.values()}
        moving = [q.column for q in self.model.inputs if self.table[q.column].nunique() > 1]
        panels = []
        for given in columns or [*moving, *(q.column for q in self.model.outputs)]:
            column = by_name.get(given, given)
            if column not in known:
                raise ResultError(f"plot: no column {given!r} here; {near_match(given, (*by_name, *known))}")
            q, values = known[column], self.table[column].to_numpy(dtype=float)
            time = self.table[TIME_COLUMN].to_numpy(dtype=float)
            seen = self.table.get(column + MEASURED)
            label = "" if seen is None else "simulated"
            traces = [Trace(label, time, values, Role.ESTIMATE, held=column in inputs)]
            if seen is not None:
                traces.insert(0, Trace("measured", time, seen.to_numpy(dtype=float), Role.TRUTH))
            panels.append(Panel(q.name.replace("_", " "), q.unit, tuple(traces), height=0.8))
        return time_figure(panels)

    def save(self, path: Path | str) -> Path:
        """Write the table, CSV or Parquet by suffix, whole or not at all; returns its path.

        Raises
        ------
        OutputError
            The file can not be written.
        """
        check_targets(self.sources, [("save", Path(path))])
        write_table(self.table, Path(path))
        return Path(path)

    def __repr__(self) -> str:
        return text_of(self._title, self._ends)

    def _repr_html_(self) -> str:
        return html_of(self._title, self._ends)

    @property
    def _quantities(self) -> tuple[Quantity, ...]:
        m = self.model
        return (*m.inputs, *m.outputs, *m.signals, *m.states)

    @property
    def _title(self) -> str:
        return f"{self.name}: {len(self.table)} rows of {self.model.name}, the first and last {ENDS} shown"

    @property
    def _ends(self) -> pd.DataFrame:
        shown = [TIME_COLUMN, *(q.column for q in (*self.model.inputs, *self.model.outputs))]
        return pd.concat([self.table.head(ENDS), self.table.tail(ENDS)])[list(dict.fromkeys(shown))]


def simulate(model: AnyModel, inputs: AnyRecord, *, accurate: bool = False) -> Simulation:
    """Simulate a table of inputs: every state, output and signal comes out.

    Row 0 is the initial condition: the states in it if it holds all of them, else the steady state of its inputs, or
    the `initial_guess` of a model that has none. With `starts_steady=False` a state starts where an output shows it.
    Each further row holds the inputs during the interval that ends at its time. What the table has of an output comes
    out beside it, with `_measured` behind the name of the column.

    Parameters
    ----------
    model
        A `Model`, the name of a process or cell, a YAML file, or "my_file:make_model".
    inputs
        CSV or Parquet file, a DataFrame, or what `read_dataset` returned: `time_s` and the model's input columns, with
        parameters by symbol or name where they move.
    accurate
        Integrate the DAE with IDAS instead of the fast step.

    Returns
    -------
    Simulation
        With the table.

    Raises
    ------
    DataError
        The table can not be used.
    RangeError
        An input, or a state on the way, leaves the model's physical range.
    ModelError, CellError, PluginError
        The model can not be used.

    Examples
    --------
    >>> import adaptive_flot as af
    >>> inputs = pd.DataFrame({"time_s": [0.0, 60.0, 120.0], "pump_voltage_V": [3.0, 3.0, 4.0]})
    >>> af.simulate("cascaded-tanks", inputs).table["level_V"].round(3).tolist()
    [9.0, 9.0, 9.521]
    """
    made, origin = read_model(model)
    sources = (*record_files(inputs), *origin.files)
    record = inputs if isinstance(inputs, Dataset) else read_dataset(inputs, made)
    return Simulation(record_name(inputs), made, simulate_record(record, made, accurate=accurate), sources)
