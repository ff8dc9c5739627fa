"""Records in several stretches: rows between which inputs are not known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from adaptive_flot.greybox.data.columns import numeric_column

STRETCH = "stretch"
"""Column that numbers the stretches; a table without it is one."""


def longest_stretch(table: pd.DataFrame, file: Path) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Rows of the longest stretch of a table, and what is left out, in words.

    No model is run across a gap: the state after it is not known.

    Raises
    ------
    DataError
        The column holds no numbers.
    """
    if STRETCH not in table.columns:
        return table, ()
    number = numeric_column(table, STRETCH, file)
    known, counts = np.unique(number[np.isfinite(number)], return_counts=True)
    if len(known) < 2:
        return table, ()
    best = int(np.argmax(counts))
    note = (
        f"the record has {len(known)} stretches with gaps between them: stretch {known[best]:g} is used, the longest, "
        f"with {counts[best]} of {counts.sum()} rows"
    )
    return table[number == known[best]], (note,)
