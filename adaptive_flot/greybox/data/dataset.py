"""Measured records: columns mapped to the names of a model, checked once, missing measurements as NaN.

Row k holds the inputs held during the interval that ends at `time[k]` and the outputs measured at that time.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path

import numpy as np
import pandas as pd

from adaptive_flot.errors import DataError, near_match
from adaptive_flot.greybox.data.columns import TIME_COLUMN as TIME_COLUMN
from adaptive_flot.greybox.data.columns import UNIFORMITY, line, numeric_column, time_column
from adaptive_flot.greybox.data.lost_rows import with_lost_rows
from adaptive_flot.greybox.data.stretches import longest_stretch
from adaptive_flot.greybox.data.tables import Source, named, read_table
from adaptive_flot.greybox.data.value_checks import check_values
from adaptive_flot.greybox.data.wrong_unit import conversion_of
from adaptive_flot.greybox.model import FloatArray, Model, Quantity

MOST_STEPS = 5_000_000
"""Most integration steps of one run over a record: some minutes on one core for a flotation cell."""
ALIKE = 0.85
"""Likeness from which a column that nothing uses may be meant for an output (1 where all letters are the same)."""
UNITS = frozenset(
    "s ms min h d m mm cm km um ft in m2 cm2 mm2 m3 cm3 mm3 dm3 Nm3 l L ml lpm cfm gpm kg g mg ug t lb mol mmol kmol "
    "pct percent ppm ppb frac V mV mA uA kW MW kWh Wh MJ kJ Ah mAh Pa hPa kPa MPa bar mbar psi C K degC degF rpm Hz "
    "kHz rad deg kN Nm kNm uS mS".split()
)
"""Parts of a suffix that make it one of a unit. Single letters that may be part of a name (A, F, W) are left out."""


@dataclass(frozen=True)
class Dataset:
    """A record of N samples for one model.

    Attributes
    ----------
    name
        What the record is called in messages and reports.
    time
        Time of each row [s] (N,), increasing by `dt`.
    dt
        Sampling interval [s].
    inputs
        (N, nu) in the model's order and units; never NaN.
    outputs
        (N, ny) in the model's order and units; NaN where missing.
    parameters
        Parameter values a row (N,) by full parameter name, where the table has them.
    initial_state
        State at the first row (nx,), where the table has all states in it.
    notes
        What of the table was left out, in words.
    """

    name: str
    time: FloatArray
    dt: float
    inputs: FloatArray
    outputs: FloatArray
    parameters: Mapping[str, FloatArray] = field(default_factory=dict)
    initial_state: FloatArray | None = None
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.time)

    def rows(self, start: int, stop: int | None = None) -> Dataset:
        """Part of the record; the initial state belongs to the first row and stays only with it."""
        cut = slice(start, stop)
        return replace(
            self,
            time=self.time[cut],
            inputs=self.inputs[cut],
            outputs=self.outputs[cut],
            parameters={k: v[cut] for k, v in self.parameters.items()},
            initial_state=self.initial_state if start == 0 else None,
        )

    def measured(self, model: Model) -> tuple[str, ...]:
        """Names of the outputs that have at least one measurement."""
        return tuple(q.name for q, y in zip(model.outputs, self.outputs.T, strict=True) if np.isfinite(y).any())


def read_dataset(path: Source, model: Model, *, required_outputs: Sequence[str] = ()) -> Dataset:
    """Read a table whose columns carry the model's column names (see `Quantity.column`) and `time_s`.

    Parameters
    ----------
    path
        CSV or Parquet file, or a table with these columns; of one in stretches the longest is read, with a note, and
        a few lost rows are put back without measurements.
    model
        Names, units and ranges. Inputs are needed; outputs and parameters are used where present. Its longest step
        bounds how long the record may be.
    required_outputs
        Outputs that must have a column.

    Raises
    ------
    DataError
        Missing column, wrong unit suffix, text in a number, NaN in an input, time that does not increase uniformly,
        more integration steps than MOST_STEPS.
    RangeError
        What is in a column can not be what it is called (`check_values`).
    """
    file = named(path)
    table, lost = with_lost_rows(read_table(path), TIME_COLUMN, file, {q.column for q in model.outputs})
    table, others = longest_stretch(table, TIME_COLUMN, file)
    columns = [str(c) for c in table.columns]
    taken = {TIME_COLUMN, *(q.column for q in (*model.inputs, *model.outputs, *model.states))}
    time = time_column(table, _find(columns, "time", TIME_COLUMN, "s", file, taken), file)
    dt = _interval(table, time, file)
    _check_steps(model, dt, len(time), file)

    inputs = np.column_stack([_input(table, columns, q, file, taken) for q in model.inputs])
    outputs = np.full((len(table), len(model.outputs)), np.nan)
    for j, q in enumerate(model.outputs):
        if q.column in columns:
            outputs[:, j] = numeric_column(table, q.column, file)
        elif q.name in required_outputs or _other_unit(columns, q.name, q.column) is not None:
            _find(columns, q.name, q.column, q.unit, file, taken)
    odd = check_values(model, inputs, outputs, time, str(file))

    parameters = {
        p.name: numeric_column(table, label, file)
        for p in model.parameters
        for label in (p.symbol, p.name)
        if label in columns
    }
    for name, values in parameters.items():
        if np.isnan(values).any():
            empty = line(table, int(np.flatnonzero(np.isnan(values))[0]))
            raise DataError(f"{file}: parameter {name!r} is empty in line {empty}; give it in every row or in none")
    first = _first_state(table, columns, model, file)
    notes = (*lost, *others, *_unmeasured(table, columns, model, taken), *odd)
    return Dataset(file.stem, time, dt, inputs, outputs, parameters, first, notes)


def check_record(record: Dataset, model: Model, table: pd.DataFrame, file: Path) -> Dataset:
    """Check what a process's own reader made of a table, and return it: `read_dataset` asks the same of any other.

    Parameters
    ----------
    record
        Row k comes from row k of the table.
    model
        The process.
    table, file
        Where it comes from, for messages.

    Raises
    ------
    DataError
        Fewer than 2 rows, a time that does not increase, an input without value, or too many integration steps.
    RangeError
        An input outside the model's physical range.
    """
    _check_count(len(record), file)
    if not (record.dt > 0 and np.isfinite(record.time).all()):
        raise DataError(f"{file}: the sampling interval is {record.dt:g} s; correct the times")
    _check_steps(model, record.dt, len(record), file)
    for q, values in zip(model.inputs, record.inputs.T, strict=True):
        _check_input(table, q.name, values, file)
    model.check_inputs(record.inputs, record.time, where=str(file))
    return record


def _find(columns: Sequence[str], name: str, column: str, unit: str, file: Path, taken: Collection[str] = ()) -> str:
    """The column of a quantity; `taken` are those of all quantities, which are right as they are."""
    if column in columns:
        return column
    other = _other_unit(columns, name, column)
    if other is not None:
        how = conversion_of(unit, other.removeprefix(f"{name}_"))
        raise DataError(
            f"{file}: column {other!r} has the wrong unit suffix; {how or f'convert it to {unit}'} and name it "
            f"{column!r}, or import it: 'adaptive-flot import' converts units"
        )
    if f"{column}_measured" in columns:
        raise DataError(f"{file}: column {column!r} is missing; of a time series of `run`, rename '{column}_measured'")
    hint = ", or make a record of an export with 'adaptive-flot import'" if column == TIME_COLUMN else ""
    free = [c for c in columns if c not in taken]
    meant = near_match(column, free) if free else "every column of the file has another use"
    raise DataError(f"{file}: column {column!r} is missing; add it ({meant}){hint}")


def _unmeasured(table: pd.DataFrame, columns: Sequence[str], model: Model, taken: Collection[str]) -> tuple[str, ...]:
    """A word on each output whose column is empty, or that has none where one that nothing uses has nearly its name."""
    said = []
    for q in model.outputs:
        if q.column in columns and not table[q.column].notna().any():
            said.append(f"{q.name} is not measured: column {q.column!r} is empty")
        free = [c for c in columns if c not in taken and not c.startswith(q.name)]  # not the truth of a simulation
        close = [] if q.column in columns else get_close_matches(q.column, free, 1, ALIKE)
        said += [f"{q.name} is not measured: there is no column {q.column!r}; {c!r} is not used" for c in close]
    return tuple(said)


def _other_unit(columns: Sequence[str], name: str, column: str) -> str | None:
    suffixed = [c for c in columns if c == name or (c.startswith(name + "_") and _looks_like_unit(c[len(name) + 1 :]))]
    return suffixed[0] if suffixed and column not in columns else None


def _looks_like_unit(suffix: str) -> bool:
    return bool(suffix) and all(part in UNITS for part in suffix.split("_"))


def _input(table: pd.DataFrame, columns: Sequence[str], q: Quantity, file: Path, taken: Collection[str]) -> FloatArray:
    values = numeric_column(table, _find(columns, q.name, q.column, q.unit, file, taken), file)
    _check_input(table, q.column, values, file)
    return values


def _check_input(table: pd.DataFrame, column: str, values: FloatArray, file: Path) -> None:
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise DataError(
            f"{file}: input {column!r} has no value in line {line(table, int(bad[0]))} ({bad.size} in all); "
            "inputs can not be missing: fill in the value that was applied, or cut the record there"
        )


def _check_count(rows: int, file: Path) -> None:
    if rows < 2:
        raise DataError(f"{file}: {rows} row; a record needs at least 2")


def _interval(table: pd.DataFrame, time: FloatArray, file: Path) -> float:
    _check_count(len(time), file)
    bad = np.flatnonzero(~np.isfinite(time))
    if bad.size:
        raise DataError(
            f"{file}: {TIME_COLUMN!r} is empty in line {line(table, int(bad[0]))}; give the time of every row"
        )
    steps = np.diff(time)
    back = np.flatnonzero(steps <= 0)
    if back.size:
        k = int(back[0]) + 1
        raise DataError(
            f"{file}: time does not increase in line {line(table, k)} ({time[k - 1]:g} s, then {time[k]:g} s); "
            "sort the rows and remove repeated ones"
        )
    dt = float(np.median(steps))
    uneven = np.flatnonzero(np.abs(steps - dt) > UNIFORMITY * dt)
    if uneven.size:
        k = int(uneven[0]) + 1
        raise DataError(
            f"{file}: time is not uniform: {steps[k - 1]:g} s before line {line(table, k)}, {dt:g} s elsewhere; "
            f"put it on an even grid with 'adaptive-flot import {file} --out even.csv', and the same --model"
        )
    return float((time[-1] - time[0]) / (len(time) - 1))


def _check_steps(model: Model, dt: float, rows: int, file: Path) -> None:
    steps = (rows - 1) * model.steps_in(dt)
    if steps > MOST_STEPS:
        raise DataError(
            f"{file}: {rows} rows, {dt:g} s apart, take {steps:.3g} steps of model {model.name!r}, whose longest is "
            f"{model.max_step_s:g} s; {MOST_STEPS} are allowed: check that the time is in seconds, or cut the record"
        )


def _first_state(table: pd.DataFrame, columns: Sequence[str], model: Model, file: Path) -> FloatArray | None:
    wanted = [q.column for q in model.states]
    if not all(c in columns for c in wanted):
        return None
    first = np.array([numeric_column(table, c, file)[0] for c in wanted])
    return first if np.isfinite(first).all() else None
