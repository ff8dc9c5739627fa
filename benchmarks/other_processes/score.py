"""The score is that of `benchmarks.plant_like`; here is what tells the processes apart.

What a plant has on every record and its model has not is no wrong name: it is struck from what was said first.
"""

from __future__ import annotations

from typing import Any

import pandas as pd


def told(answer: dict[str, Any]) -> dict[str, object]:
    """Columns of a table of results that come from the answer of a record."""
    reference = "yes" if answer["reference"] else ""
    return {"process": answer["process"], "case": answer["case"], "reference": reference}


def by_process(table: pd.DataFrame) -> pd.DataFrame:
    """Number of each outcome by process."""
    return pd.crosstab(table["process"], table["outcome"]).reset_index()
