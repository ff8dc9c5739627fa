"""A record from a file, a table, or a record at hand."""

from __future__ import annotations

from pathlib import Path
from typing import TypeAlias

import pandas as pd

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.data.tables import named

AnyRecord: TypeAlias = Path | str | pd.DataFrame | Dataset
"""A CSV or Parquet file, a table with the model's columns, or a record from `read_dataset`."""


def record_name(data: AnyRecord) -> str:
    """What reports and notes call a record.

    >>> record_name("plant/monday.csv"), record_name(pd.DataFrame())
    ('monday.csv', 'DataFrame')
    """
    return data.name if isinstance(data, Dataset) else named(data).name
