"""A record from a file, a table, or a record at hand; a map from a file, or one at hand."""

from __future__ import annotations

from pathlib import Path
from typing import TypeAlias

import pandas as pd

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.data.tables import named
from adaptive_flot.records.tag_map import TagMap, load_tag_map

AnyRecord: TypeAlias = Path | str | pd.DataFrame | Dataset
"""A CSV or Parquet file, a table with the model's columns, or a record from `read_dataset`."""
SeveralRecords: TypeAlias = list[AnyRecord] | tuple[AnyRecord, ...]
"""Several records of one process."""
AnyMap: TypeAlias = Path | str | TagMap
"""A map file, or a map at hand."""


def read_map(given: AnyMap | None) -> TagMap | None:
    """Map behind what the user gave.

    Raises
    ------
    DataError
        The file can not be used.
    """
    return load_tag_map(given) if isinstance(given, (str, Path)) else given


def record_files(data: AnyRecord, tag_map: AnyMap | None = None) -> tuple[Path, ...]:
    """Files of a record and its map, which no result may overwrite; none of what is at hand.

    >>> record_files(pd.DataFrame())
    ()
    """
    return tuple(Path(given).absolute() for given in (data, tag_map) if isinstance(given, str | Path))


def record_name(data: AnyRecord) -> str:
    """What reports and notes call a record.

    >>> record_name("plant/monday.csv"), record_name(pd.DataFrame())
    ('monday.csv', 'DataFrame')
    """
    return data.name if isinstance(data, Dataset) else named(data).name
