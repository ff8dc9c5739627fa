"""An input that nobody records is given by the map; whatever else is called constant is refused with the reason."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.errors import AdaptiveFlotError
from adaptive_flot.greybox.model import Model
from adaptive_flot.records.importing import Imported, import_table, read_with_map
from adaptive_flot.records.quality.quality import judge
from adaptive_flot.records.tag_map import load_tag_map
from tests.records.exports import Plant

FEED = "feed_flow: {constant: 10, unit: L/min}\n"


def export() -> pd.DataFrame:
    """The plant without its feed flow."""
    return Plant().columns().drop(columns="FIC_102.PV [L/min]")


def imported(folder: Path, model: Model, text: str) -> Imported:
    file = folder / "map.yaml"
    file.write_text(text)
    return import_table(export(), model, load_tag_map(file))


def test_a_constant_of_the_map_stands_in_every_row(tmp_path: Path, model: Model) -> None:
    found = imported(tmp_path, model, FEED)
    table = found.table()
    assert np.allclose(table["feed_flow_m3_s"], 10 / 60_000, rtol=1e-12)
    assert set(table["feed_flow_status"]) == {"constant"}
    assert np.allclose(table["air_flow_m3_s"], Plant().air[:-1])
    assert any("feed_flow" in s and "no dependence on it can be told" in s for s in judge(found).sentences())


def test_the_whole_map_with_a_constant_is_read_back_and_gives_the_same_record(tmp_path: Path, model: Model) -> None:
    first = imported(tmp_path, model, FEED)
    (tmp_path / "whole.yaml").write_text(first.tag_map.text())
    whole = load_tag_map(tmp_path / "whole.yaml")
    assert whole == first.tag_map
    pd.testing.assert_frame_equal(read_with_map(export(), model, whole), first.table())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("feed_flow: {constant: 10, unit: m3/s}", r"outside what is possible .* correct value or unit in the map"),
        ("feed_flow: {constant: 10, unit: kg}", "unit 'kg' can not be converted"),
        ("feed_flow: {constant: 10}", "line 1: key 'feed_flow.unit' is missing"),
        ("feed_flow: {constant: 10, unit: L/min, tag: FIC_102.PV}", "unknown key 'feed_flow.tag'"),
        ("concentrate_grade: {constant: 0.2, unit: '-'}", "an output of model 'flotation' is measured"),
        ("n: {constant: 1, unit: '-'}", "a parameter of model 'flotation', .* give its value in the cell"),
        (
            f"{FEED}air_flow: {{constant: 90, unit: L/min}}\nlevel_setpoint: {{constant: 380, unit: mm}}",
            "all inputs of model 'flotation' are constant",
        ),
    ],
)
def test_a_constant_that_can_not_be_is_refused(tmp_path: Path, model: Model, text: str, said: str) -> None:
    with pytest.raises(AdaptiveFlotError, match=said) as caught:
        imported(tmp_path, model, text)
    assert len(str(caught.value).splitlines()) == 1
