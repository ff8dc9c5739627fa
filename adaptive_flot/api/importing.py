"""Import an export from Python."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import pandas as pd

from adaptive_flot.api.models import AnyModel, read_model
from adaptive_flot.api.records import AnyMap, read_map
from adaptive_flot.api.shown import html_of, text_of
from adaptive_flot.errors import DataError
from adaptive_flot.files import write_text
from adaptive_flot.greybox.data.tables import Source, write_table
from adaptive_flot.records import described
from adaptive_flot.records.importing import Imported, import_table
from adaptive_flot.records.quality.quality import Quality, judge
from adaptive_flot.records.tag_map import TagMap


@dataclass(frozen=True, repr=False)
class ImportedRecord:
    """What `import_record` returns.

    Attributes
    ----------
    imported
        Everything behind the record: the export, cleaned values, rows.
    """

    imported: Imported

    @cached_property
    def table(self) -> pd.DataFrame:
        """The record; `estimate`, `discover` and `read_dataset` accept it."""
        return self.imported.table()

    @property
    def tag_map(self) -> TagMap:
        """The whole map: what was given, and what was found out."""
        return self.imported.tag_map

    @cached_property
    def quality(self) -> Quality:
        """How good the record is; `quality.sentences()` says what follows."""
        return judge(self.imported)

    def save(self, path: Path | str) -> Path:
        """Write the record, `.parquet` or `.csv`, whole or not at all; returns its path.

        Raises
        ------
        OutputError
            The file can not be written.
        """
        write_table(self.table, Path(path))
        return Path(path)

    def save_map(self, path: Path | str) -> Path:
        """Write the map (YAML), for the next export of these tags; returns its path.

        Raises
        ------
        OutputError
            The file can not be written.
        """
        write_text(Path(path), self.tag_map.text())
        return Path(path)

    def report(self, path: Path | str) -> Path:
        """Write the page on the quality of the record as one HTML file; returns its path.

        Raises
        ------
        OutputError
            The file can not be written.
        """
        from adaptive_flot.report.quality.page import write_quality_report

        write_quality_report(self.imported, self.quality, path)
        return Path(path)

    def __repr__(self) -> str:
        return text_of(self._title, self._shown)

    def _repr_html_(self) -> str:
        return html_of(self._title, self._shown)

    @property
    def _title(self) -> str:
        return f"{self.imported.export.file.name}: {described.result(self.imported)}"

    @property
    def _shown(self) -> pd.DataFrame:
        return pd.DataFrame(described.converted(self.imported), columns=["quantity", "tag", "export", "record"])


def import_record(
    export: Source, model: AnyModel = "flotation", *, tag_map: AnyMap | None = None, accept: bool = False
) -> ImportedRecord:
    """Bring an export of a plant's historian into the shape of a record.

    Parameters
    ----------
    export
        CSV, Parquet or xlsx file, or a DataFrame. It is only read.
    model
        A `Model`, the name of a process or cell, a YAML file, or "my_file:make_model": whose quantities are looked for.
    tag_map
        Map file (or `TagMap`) from tags to quantities; what it leaves out is found out.
    accept
        Accept what was found out and not given. Without it, the error says what that is.

    Returns
    -------
    ImportedRecord
        The record, the whole map, and how good the record is.

    Raises
    ------
    DataError, RangeError
        The export can not be used, several readings are equally good, or something was found out and not accepted.

    Examples
    --------
    >>> import adaptive_flot as af
    >>> export = pd.DataFrame({"Timestamp": pd.date_range("2026-03-01", periods=40, freq="10s")})
    >>> export["Air flow [L/min]"], export["Feed flow [L/min]"], export["Level SP [mm]"] = 90.0, 10.0, 380.0
    >>> record = af.import_record(export, accept=True)
    >>> print(record.tag_map.quantities["air_flow"].tag, record.table["air_flow_status"].iloc[0])
    Air flow measured
    """
    made, _ = read_model(model)
    imported = import_table(export, made, read_map(tag_map) or TagMap())
    if imported.guessed and not accept:
        lines = " ".join(imported.tag_map.text().split("\n"))
        raise DataError(
            f"{imported.export.file}: found out and not given: {', '.join(imported.guessed)}; accept=True accepts it, "
            f"or give a map: {lines.strip()}"
        )
    return ImportedRecord(imported)
