"""The strips of an imported record: what is between two stretches has no rows, and no status."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.greybox.model import Model
from adaptive_flot.records.importing import import_table
from adaptive_flot.records.tag_map import TagMap
from adaptive_flot.report.quality import series
from tests.records.exports import STEP, Plant

HOLE = slice(30, 45)


@pytest.mark.parametrize("most", [600, 10])
def test_a_gap_is_shown_as_such_and_not_as_the_status_before_it(
    model: Model, monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    """Also where a mark stands for several rows."""
    monkeypatch.setattr(series, "MOST_SPELLS", most)
    table = Plant().columns().drop(index=range(HOLE.start, HOLE.stop)).reset_index(drop=True)
    imported = import_table(table, model, TagMap())
    rows = imported.rows
    time = (rows.time - rows.time[0]) / 1e9
    last, first = time[rows.stretch == 1][-1], time[rows.stretch == 2][0]
    for strip in series.strips(imported):
        (gap,) = [(a, b) for state, a, b in strip.spells() if state == series.GAP]
        assert gap == (last, first - STEP)
        assert strip.spells()[0][1] == -STEP if most == 600 else strip.spells()[0][1] < 0
        assert strip.spells()[-1][2] == time[-1]
        assert np.all(np.diff(strip.time) > 0)
