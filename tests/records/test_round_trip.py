"""A record that is written as any export comes back equal: separators, decimals, thousands, units, zones, forms."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.greybox.model import Model
from adaptive_flot.records.importing import import_table
from adaptive_flot.records.tag_map import TagMap
from adaptive_flot.records.units import convert
from tests.records.exports import long_form

FLOWS = ("L/min", "m3/h", "L/s", "gpm", "m3/s", "cfm")
LENGTHS = ("mm", "cm", "m", "in", "ft")
SHARES = ("%", "-", "ppm")
FORMS = ("%Y-%m-%d %H:%M:%S", "%d.%m.%Y %H:%M:%S", "%Y/%m/%d %H:%M:%S", "%d-%b-%Y %H:%M:%S")
ZONES = ("UTC", "Europe/London", "America/Santiago", "Asia/Kolkata")


def shown(value: float, decimal: str, thousands: str) -> str:
    text = f"{value:,.17g}" if thousands and 1 <= abs(value) < 1e15 else f"{value:.17g}"
    return text.replace(",", "~").replace(".", decimal).replace("~", thousands)


@st.composite
def writings(draw: st.DrawFn) -> dict[str, str]:
    separator = draw(st.sampled_from([",", ";", "\t", "|"]))
    decimal = draw(st.sampled_from([".", ","] if separator != "," else ["."]))
    others = {",": ["", ".", " ", "'"], ".": ["", " ", "'"] + ([","] if separator != "," else [])}
    return {
        "separator": separator,
        "decimal": decimal,
        "thousands": draw(st.sampled_from(others[decimal])),
        "flow": draw(st.sampled_from(FLOWS)),
        "length": draw(st.sampled_from(LENGTHS)),
        "share": draw(st.sampled_from(SHARES)),
        "form": draw(st.sampled_from(FORMS)),
        "zone": draw(st.sampled_from(ZONES)),
        "encoding": draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"])),
        "shape": draw(st.sampled_from(["wide", "long"])),
    }


@settings(max_examples=30)
@given(how=writings(), seed=st.integers(0, 2**16))
def test_a_record_comes_back_equal(
    tmp_path_factory: pytest.TempPathFactory, model: Model, how: dict[str, str], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    n = 30
    instants = pd.date_range("2026-07-13 22:00", periods=n, freq="20s", tz="UTC")
    air, feed = rng.uniform(1e-3, 2e-3, n), rng.uniform(1.5e-4, 1.8e-4, n)
    level, grade = rng.uniform(0.35, 0.42, n), rng.uniform(0.15, 0.35, n)
    units = {"air_flow": how["flow"], "feed_flow": how["flow"], "level_setpoint": how["length"]}
    units["concentrate_grade"] = how["share"]
    truth = {"air_flow": air, "feed_flow": feed, "level_setpoint": level, "concentrate_grade": grade}
    si = {"air_flow": "m3/s", "feed_flow": "m3/s", "level_setpoint": "m", "concentrate_grade": "-"}
    table = pd.DataFrame({"Timestamp": instants.tz_convert(how["zone"]).strftime(how["form"])}).astype(object)
    for name, values in truth.items():
        written = convert(values, si[name], units[name])
        table[name] = [shown(v, how["decimal"], how["thousands"]) for v in written]
    table = long_form(table) if how["shape"] == "long" else table
    file = tmp_path_factory.getbasetemp() / "export.csv"
    file.write_bytes(table.to_csv(index=False, sep=how["separator"]).encode(how["encoding"]))
    keys = {name: {"tag": name, "unit": unit, "bad": []} for name, unit in units.items()}
    given_map = TagMap.model_validate(
        {
            "file": {"decimal": how["decimal"], "form": how["shape"]},
            "time": {"column": "Timestamp", "zone": how["zone"]},
            "grid": {"step": "20 s", "hold_at_most": "60 s"},
            **keys,
        }
    )
    imported = import_table(file, model, given_map)
    found = imported.table()
    assert imported.guessed == () and len(found) == n - 1
    assert list(found["time_utc"]) == list(instants[1:])
    for name in ("air_flow", "feed_flow", "level_setpoint"):
        column = next(q.column for q in model.inputs if q.name == name)
        np.testing.assert_allclose(found[column], truth[name][:-1], rtol=1e-14)
        assert set(found[f"{name}_status"]) == {"measured"}
    np.testing.assert_allclose(found["concentrate_grade"], grade[1:], rtol=1e-14)
