"""`af.import_record`: what it gives, and that a guess must be accepted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import adaptive_flot as af
from adaptive_flot.errors import DataError
from adaptive_flot.greybox.model import Model
from adaptive_flot.records.tag_map import load_tag_map
from tests.records.exports import Plant


def test_a_guess_must_be_accepted_and_is_told(model: Model) -> None:
    with pytest.raises(DataError) as caught:
        af.import_record(Plant().columns(), model)
    message = str(caught.value)
    assert message.startswith("DataFrame: found out and not given: time, grid, air_flow")
    assert "accept=True" in message and "air_flow: {tag: FIC_101.PV, unit: L/min}" in message


def test_table_map_and_page_of_a_table_at_hand(model: Model, tmp_path: Path) -> None:
    """The map that is saved needs no guess, and gives the same record."""
    export = Plant().columns()
    before = export.copy()
    found = af.import_record(export, model, accept=True)
    pd.testing.assert_frame_equal(export, before)
    file = found.save_map(tmp_path / "map.yaml")
    again = af.import_record(export, model, tag_map=file)
    pd.testing.assert_frame_equal(found.table, again.table)
    assert load_tag_map(file) == found.tag_map
    page = found.report(tmp_path / "page.html").read_text()
    assert all(sentence.split(":")[0].replace("_", " ") in page for sentence in found.quality.sentences())
    assert "FIC_101.PV" in repr(found) and "59 rows" in repr(found)
    read = af.read_dataset(found.save(tmp_path / "record.parquet"), model)
    np.testing.assert_array_equal(read.inputs[:, 0], found.table["air_flow_m3_s"])
