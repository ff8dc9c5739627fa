"""A journey: a historian's export of a heated tank, imported, asked what the model lacks, and the pages read."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd

from tests.browser.conftest import Check
from tests.cli.conftest import Call
from tests.discovery.heated import DT, tank_record

HOLE = slice(400, 430)
MODEL = "from tests.discovery.heated import heated_tank as make_model\n"


def historian_export(folder: Path) -> Path:
    """Local times, decimal comma, plant units, bad values, a hole in time, a spike."""
    record = tank_record(rows=450)
    count = len(record)
    stamps = pd.date_range("2026-03-28 22:00", periods=count + 1, freq=f"{DT:g}s", tz="UTC").tz_convert("Europe/London")
    power, fan = np.append(record.inputs[:, 0], np.nan) / 1000, np.append(record.inputs[:, 1], np.nan) * 60
    temperature = np.insert(record.outputs[:, 0], 0, np.nan) - 273.15
    table = pd.DataFrame({"Zeit": stamps.strftime("%d.%m.%Y %H:%M:%S")}).astype(object)
    for tag, values in (("JI_301.PV [kW]", power), ("SI_302.PV [rpm]", fan), ("TI_303.PV [°C]", temperature)):
        table[tag] = ["" if np.isnan(v) else f"{v:.10g}".replace(".", ",") for v in values]
    table.loc[100:101, "TI_303.PV [°C]"] = "Bad Input"
    table.loc[200, "TI_303.PV [°C]"] = "999"
    table.loc[300, "SI_302.PV [rpm]"] = "I/O Timeout"
    table = table.drop(index=range(HOLE.start, HOLE.stop))
    file = folder / "tank.csv"
    file.write_bytes(("Werk 3\n\n" + table.to_csv(index=False, sep=";")).encode("cp1252"))
    return file


def test_from_a_historian_to_the_physics_that_the_model_lacks(call: Call, tmp_path: Path, right: Check) -> None:
    """The loss by the fan is named; the hole splits the record, and the page says which part was used."""
    file = historian_export(tmp_path)
    (tmp_path / "my_tank.py").write_text(MODEL)
    (tmp_path / "zone.yaml").write_text("time: {column: Zeit, zone: Europe/London}\n")
    model = ["--model", "my_tank:make_model"]
    done = call("import", file, *model, "--map", "zone.yaml", "--out", "tank.parquet", "--yes")
    assert done.code == 0, done.err
    assert "in 2 stretches" in done.out and "Bad Input" in (tmp_path / "tank.map.yaml").read_text()
    table = pd.read_parquet(tmp_path / "tank.parquet")
    assert table["temperature_K"].between(280, 350).sum() == table["temperature_K"].notna().sum()
    record = tank_record(rows=450)
    assert np.allclose(table["power_W"][:300], record.inputs[:300, 0], rtol=1e-8)

    found = call("discover", "tank.parquet", *model, "--processes", 1, "--out", "found")
    assert found.code == 0, found.err
    verdict = json.loads((tmp_path / "found" / "verdict.json").read_text())
    assert verdict["verdict"] == "named"
    assert [(e["site"], e["driver"]) for e in verdict["effects"]] == [("heat_loss", "fan_speed")]
    assert any("stretch 1 is used, the longest" in note for note in verdict["notes"])
    assert "<h1>Heat loss depends on fan speed: " in (tmp_path / "found" / "report.html").read_text()
    right(tmp_path / "tank.quality.html", tmp_path / "found" / "report.html")
