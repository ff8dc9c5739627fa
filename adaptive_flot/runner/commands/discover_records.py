"""Discovery on several files: what has changed since a reference, or what a model lacks in records of one process."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from adaptive_flot.discovery.hypotheses.procedure import Comparison
from adaptive_flot.discovery.since_reference.changes import find_changes
from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.dataset import TIME_COLUMN, Dataset
from adaptive_flot.greybox.data.lost_rows import with_lost_rows
from adaptive_flot.greybox.data.stretches import every_stretch
from adaptive_flot.greybox.data.tables import Source, named, read_table
from adaptive_flot.greybox.model import Model
from adaptive_flot.processes.model_writer import save_model
from adaptive_flot.processes.registry import read_measurements
from adaptive_flot.provenance import values_hash
from adaptive_flot.records.importing import is_record
from adaptive_flot.records.tag_map import TagMap

MOST_ROWS = 0.5
"""Share of the rows from which the longest stretch stands for a record."""


def discover_records(
    sources: Sequence[Source | Dataset],
    model: Model,
    references: Sequence[Source | Dataset] = (),
    *,
    tag_map: TagMap | None = None,
    processes: int = 1,
    progress: Callable[[str], None] = lambda stage: None,
    budget: float | None = None,
) -> Comparison:
    """Read records, and find what has changed since the references; without any, what the model lacks in all of them.

    Parameters
    ----------
    sources
        New records of one process: CSV or Parquet files, tables, or records at hand.
    model
        The model, with sites.
    references
        Records on which the model was right.
    tag_map
        From the tags of exports to the model's quantities.
    processes
        Fits that run at once.
    progress
        Called with a word for each stage and each fit.
    budget
        Seconds after which nothing more is searched for, see `find_changes`.

    Raises
    ------
    DataError, RangeError, ModelError
        A table or the model can not be used, or a record is given twice.
    """
    alone = bool(references)  # events in time take one record, and a short stretch adds little but a start of its own
    groups = [[(_called(s), _read(s, model, tag_map, alone)) for s in group] for group in (sources, references)]
    _check_once([record for group in groups for record in group])
    new, old = ([part for _, parts in group for part in parts] for group in groups)
    return find_changes(model, new, old, processes=processes, progress=progress, budget=budget)


def save_extended(
    comparison: Comparison, name: str, path: Path, *, base: str, cell: str | None, folder: Path | None
) -> bool:
    """Write the model with what was named, with the constants of the reference else, as a model file.

    `base`, `cell` and `folder` are what the model was made from, see `save_model`.
    """
    note = f"discovered in {name}: {comparison.verdict.word}"
    save_model(comparison.model, path, base=base, cell=cell, folder=folder, note=note)
    return True


def _called(source: Source | Dataset) -> str:
    return source.name if isinstance(source, Dataset) else str(named(source))


def _check_once(records: Sequence[tuple[str, Sequence[Dataset]]]) -> None:
    """Refuse a record that is given twice, under whatever name: its rows would count as evidence of two.

    Raises
    ------
    DataError
        Two of them hold the same values.
    """
    seen: dict[str, str] = {}
    for name, parts in records:
        values = values_hash(array for r in parts for array in (r.time, r.inputs, r.outputs))
        if values in seen:
            raise DataError(f"{name}: the same record as {seen[values]}; give each once")
        seen[values] = name


def _read(source: Source | Dataset, model: Model, tag_map: TagMap | None, alone: bool) -> list[Dataset]:
    """A record, or each of its stretches: nothing is fitted across a gap.

    Where it may stand `alone`, the longest stretch is the record if it has most of the rows; a note of it says so.
    """
    if isinstance(source, Dataset):
        return [source]
    if tag_map is None or is_record(source, model):
        empty = {q.column for q in model.outputs}
        table, lost = with_lost_rows(read_table(source), TIME_COLUMN, named(source), empty)
        parts = every_stretch(table, TIME_COLUMN, named(source))
        most = max(map(len, parts)) >= MOST_ROWS * sum(map(len, parts))
        if len(parts) > 1 and not (alone and most):
            stem = named(source).stem
            read = [read_measurements(part, model).record for part in parts]
            parted = f"{stem} has {len(parts)} stretches with gaps between them, and each is taken as a record"
            notes = [(*lost, parted, *r.notes) if r is read[0] else r.notes for r in read]
            return [
                replace(r, name=f"{stem}, stretch {k}", notes=said)
                for k, (r, said) in enumerate(zip(read, notes, strict=True), start=1)
            ]
    return [read_measurements(source, model, tag_map=tag_map).record]
