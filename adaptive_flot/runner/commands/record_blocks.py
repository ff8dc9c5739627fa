"""A measured record in two blocks: one to fit, one to test."""

from __future__ import annotations

from dataclasses import dataclass, replace

from adaptive_flot.described import Described
from adaptive_flot.discovery.record.screening import clean_outputs
from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.data.tables import Source, named
from adaptive_flot.greybox.model import Model
from adaptive_flot.processes.registry import read_measurements
from adaptive_flot.records.tag_map import TagMap


@dataclass(frozen=True, repr=False)
class Blocks(Described):
    """A record in two blocks: `fit` (parameters come from here only) and `test`.

    `continues` tells whether the test block goes on where the fit block ends, or starts from the same initial state.
    """

    name: str
    fit: Dataset
    test: Dataset
    continues: bool

    @property
    def tested(self) -> int:
        """Rows of the test block that fitted nothing; where it continues, its first row is the last one to fit."""
        return len(self.test) - int(self.continues)

    def described(self) -> dict[str, object]:
        """The record and its cut; see `Described`."""
        return {"record": self.name, "rows to fit": len(self.fit), "rows to test": self.tested}


def read_blocks(path: Source, model: Model, fit_share: float, tag_map: TagMap | None = None) -> Blocks:
    """Read a record (with a map: an export) and cut it into fit and test block.

    A published file with a record for validation has both blocks; any other record is cut in time at `fit_share`.

    Raises
    ------
    DataError, RangeError
        The table can not be used.
    """
    measured = read_measurements(path, model, required_outputs=(model.outputs[0].name,), tag_map=tag_map)
    record, found, _ = clean_outputs(measured.record, model)
    record, validation = replace(record, notes=record.notes + found), measured.validation
    if validation is None:
        return cut(record, fit_share, str(named(path)))
    return Blocks(record.name.partition(":")[0], record, validation, continues=False)


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
