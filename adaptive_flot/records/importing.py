"""Import an export: read it, complete the map, clean the values, put them on a grid, and make the record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.columns import STRETCH
from adaptive_flot.greybox.data.dataset import TIME_COLUMN
from adaptive_flot.greybox.data.tables import Source, read_table
from adaptive_flot.greybox.model import Model, Quantity
from adaptive_flot.records.clean import Cleaned, clean, constant
from adaptive_flot.records.grid import STATUSES, Rows, make_rows
from adaptive_flot.records.guess import guess_tags
from adaptive_flot.records.habits import complete_habits
from adaptive_flot.records.reading.export import Export
from adaptive_flot.records.reading.signals import read_export
from adaptive_flot.records.tag_map import TagMap
from adaptive_flot.records.units import seconds

CLOCK_COLUMN = "time_utc"


@dataclass(frozen=True)
class Imported:
    """An export on its way to a record.

    Attributes
    ----------
    export
        What was read.
    model
        The model whose quantities are looked for.
    tag_map
        The whole map: what was given, and what was found out.
    guessed
        What the map that was given did not say: sections, and quantities.
    cleaned
        Values of each quantity at their own times, and what became of them.
    rows
        The values on the grid.
    """

    export: Export
    model: Model
    tag_map: TagMap
    guessed: tuple[str, ...]
    cleaned: tuple[Cleaned, ...]
    rows: Rows

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Inputs, then outputs, that the record has."""
        return tuple(c.quantity for c in self.cleaned)

    def is_input(self, name: str) -> bool:
        """Whether a quantity is an input."""
        return name in self.model.names("inputs")

    def table(self) -> pd.DataFrame:
        """The record, with the columns that `read_dataset` reads.

        Time [s] from the first row, or as in the table where that was a record; `stretch`, where there are several; a
        column a quantity, named with its unit; a status a quantity (`air_flow_status`): measured, held, averaged,
        missing, bad or constant; and the time in UTC, where the export is dated.
        """
        rows = self.rows
        since = ((rows.time - rows.time[0]) // rows.step) * (rows.step / 1e9)
        own = self.export.time_keys.column == TIME_COLUMN and not self.dated
        columns: dict[str, object] = {TIME_COLUMN: since + rows.time[0] / 1e9 if own else since}
        if rows.stretch[-1] > 1:
            columns[STRETCH] = rows.stretch
        columns |= {q.column: rows.values[q.name] for q in self.quantities}
        for q in self.quantities:
            columns[f"{q.name}_status"] = np.array(STATUSES, dtype=object)[rows.statuses[q.name]]
        if self.dated:
            columns[CLOCK_COLUMN] = pd.DatetimeIndex(rows.time.astype("datetime64[ns]")).tz_localize("UTC")
        return pd.DataFrame(columns)

    @property
    def dated(self) -> bool:
        """Whether the times of the export are dates."""
        return self.tag_map.time.format not in ("seconds", "minutes", "hours")


def import_table(source: Source, model: Model, given: TagMap, *, outputs: bool | None = None) -> Imported:
    """Import an export for a model.

    Parameters
    ----------
    source
        CSV, Parquet or xlsx file, or a table at hand. It is only read.
    model
        The model: its inputs are needed, its outputs used where they are found.
    given
        The map, or part of one, or an empty one; what it does not say is guessed.
    outputs
        Whether to look for outputs that the map does not name; default where it does not name all inputs either.

    Raises
    ------
    UnclearError
        Several readings are equally good: the user must choose.
    DataError, RangeError
        The export can not be used.
    """
    export = read_export(source, given)
    missing = [q.column for q in model.inputs if q.column not in export.signals]
    if export.time_keys.column == TIME_COLUMN and not missing:
        export = acting_from_the_row_before(export, model.inputs)
    else:
        export = replace(export, found=(*export.found, _acting_from_its_stamp(export, missing)))
    whole = all(given.names(q.name) for q in model.inputs)
    full = given.model_copy(update={"file": export.file_keys, "time": export.time_keys})
    full = guess_tags(export, model, full, outputs=not whole if outputs is None else outputs)
    full = complete_habits(export, model, full)
    cleaned = tuple(
        constant(q, full.constants[q.name], export.file)
        if q.name in full.constants
        else clean(export.signals[full.quantities[q.name].tag], q, full.quantities[q.name], export.file)
        for q in (*model.inputs, *model.outputs)
        if full.names(q.name)
    )
    count = len(model.inputs)
    grid = full.grid
    rows = make_rows(
        cleaned[:count],
        cleaned[count:],
        seconds(grid.step or ""),
        seconds(grid.hold_at_most or ""),
        grid.gaps,
        export.file,
    )
    return Imported(export, model, full, _guessed(given, full), cleaned, rows)


def _acting_from_its_stamp(export: Export, missing: Sequence[str]) -> str:
    """The rule for the times of inputs, and what makes a table look like a record that it is not."""
    rule = "an input acts from its stamp on, so it stands in the row after"
    if export.time_keys.column != TIME_COLUMN:
        return rule
    return f"no record yet, as it has no column {missing[0]!r}: {rule}; name it so if inputs act up to their row"


def acting_from_the_row_before(export: Export, inputs: Sequence[Quantity]) -> Export:
    """The export of a table that is a record already: its inputs acted during the interval that ends at their row.

    In an export of a plant they act from their stamp on. So each input gets the time of the row before, and the first
    one a time that is a usual interval earlier.
    """
    signals = dict(export.signals)
    for column in (q.column for q in inputs):
        time = signals[column].time
        usual = int(np.median(np.diff(time))) if len(time) > 1 else 1
        signals[column] = replace(signals[column], time=np.concatenate([time[:1] - usual, time[:-1]]))
    return replace(export, signals=signals, found=(*export.found, "a record already: an input acts up to its row"))


def _guessed(given: TagMap, full: TagMap) -> tuple[str, ...]:
    """What decides the numbers of a record and was not given."""
    found = ["time"] if given.time.column is None else []
    found += ["grid"] if given.grid.step is None or given.grid.hold_at_most is None else []
    for name in full.quantities:
        own = given.quantities.get(name)
        found += [name] if own is None or own.unit is None else []
    return tuple(found)


def read_with_map(source: Source, model: Model, tag_map: TagMap) -> pd.DataFrame:
    """Record of an export whose map says everything that decides its numbers.

    Raises
    ------
    DataError
        The map leaves something open, or the export can not be used.
    RangeError
        Values in another unit than the map says.
    """
    imported = import_table(source, model, tag_map, outputs=False)
    if imported.guessed:
        raise DataError(
            f"{imported.export.file}: the map does not say {', '.join(imported.guessed)}; complete it, or let "
            "'adaptive-flot import' write one"
        )
    return imported.table()


def is_record(source: Source, model: Model) -> bool:
    """Whether a table is a record of the model already, and no export."""
    try:
        columns = set(read_table(source).columns)
    except DataError:  # of a form that only the importer reads
        return False
    return {TIME_COLUMN, *(q.column for q in model.inputs)} <= columns
