"""Thirty and more ugly exports: each comes through with the right numbers, or is refused with the right words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.errors import AdaptiveFlotError
from adaptive_flot.greybox.model import Model
from adaptive_flot.records.importing import import_table
from adaptive_flot.records.tag_map import TagMap, load_tag_map
from tests.records import exports
from tests.records.exports import Plant, lines, long_form, to_book, to_text

Change = Callable[[pd.DataFrame], pd.DataFrame]
PLANT = Plant()
CSV = to_text()
SHORT = ("FIC_101.PV [L/min]", "FIC_102.PV [L/min]", "LIC_201.SP [mm]", "AI_401.PV [%]")


def same(table: pd.DataFrame) -> pd.DataFrame:
    return table


def put(column: str, row: int, value: object) -> Change:
    def change(table: pd.DataFrame) -> pd.DataFrame:
        return table.assign(**{column: table[column].where(np.arange(len(table)) != row, value)})

    return change


def stamped(form: str) -> Change:
    return lambda t: t.assign(Timestamp=PLANT.stamps.strftime(form))


def numbered(zero: str, unit: str) -> Change:
    def change(table: pd.DataFrame) -> pd.DataFrame:
        return table.assign(
            Timestamp=[repr(float(v)) for v in (PLANT.stamps - pd.Timestamp(zero)) / pd.Timedelta(unit)]
        )

    return change


@dataclass(frozen=True)
class Sound:
    """An export that comes through; `missing` are the rows (from 0) whose grade is missing."""

    change: Change = same
    write: Callable[[pd.DataFrame, Path], Path] = CSV
    given: str = ""
    missing: tuple[int, ...] = ()
    zone_h: float = 0.0


SOUND = {
    "tidy": Sound(),
    "utf-8 with byte order mark": Sound(write=to_text("utf-8-sig")),
    "utf-16 with tabs": Sound(write=to_text("utf-16", "\t")),
    "utf-16 without mark": Sound(write=to_text("utf-16-le", ";")),
    "windows-1252 with a degree sign": Sound(lambda t: t.assign(**{"TI_5 [°C]": 25.0}), to_text("cp1252")),
    "semicolons and decimal comma": Sound(write=to_text(separator=";", decimal=",")),
    "decimal comma and thousands with dots": Sound(
        lambda t: t.assign(**{"Speed [rpm]": 1234.5}), to_text(separator=";", decimal=",", thousands=".")
    ),
    "thousands with commas in quotes": Sound(lambda t: t.assign(**{"Speed [rpm]": 1234.5}), to_text(thousands=",")),
    "thousands with narrow spaces": Sound(
        lambda t: t.assign(**{"Speed [rpm]": 1234.5}), to_text(separator=";", decimal=",", thousands=" ")
    ),
    "preamble, units in a row of their own, footer": Sound(
        lambda t: t.set_axis([c.split(" [")[0] for c in t.columns], axis=1),
        lines(lambda ls: ["Report of line 3", "", ls[0], ",L/min,L/min,mm,%", *ls[1:], "End of report"]),
    ),
    "separator told in the first line": Sound(
        write=lambda t, folder: _prefixed(to_text(separator=";")(t, folder), "sep=;\n")
    ),
    "long form with quality": Sound(long_form),
    "long form, poor quality": Sound(
        lambda t: long_form(t).assign(Quality=lambda x: np.where(x.index == len(t) * 3 + 8, "Bad", "Good")),
        missing=(7,),
    ),
    "spreadsheet with dates": Sound(write=to_book()),
    "spreadsheet with dates as text": Sound(write=to_book(dates=False)),
    "parquet": Sound(write=exports.to_parquet),
    "gzip": Sound(write=exports.gzipped),
    "day first, seen by the 14th": Sound(stamped("%d/%m/%Y %H:%M:%S")),
    "month first with am and pm": Sound(stamped("%m/%d/%Y %I:%M:%S %p")),
    "dots": Sound(stamped("%d.%m.%Y %H:%M:%S")),
    "month by name": Sound(stamped("%d-%b-%y %H:%M:%S.0")),
    "iso with offset": Sound(stamped("%Y-%m-%dT%H:%M:%S+02:00"), zone_h=-2.0),
    "date and time of day apart": Sound(
        lambda t: t.assign(Timestamp=PLANT.stamps.strftime("%Y-%m-%d")).assign(Clock=PLANT.stamps.strftime("%H:%M:%S"))
    ),
    "form given by a map": Sound(stamped("%Y%m%d %H%M%S"), given="time: {column: Timestamp, format: '%Y%m%d %H%M%S'}"),
    "days of a spreadsheet": Sound(numbered("1899-12-30", "1D")),
    "seconds since 1970": Sound(numbered("1970-01-01", "1s")),
    "milliseconds since 1970": Sound(numbered("1970-01-01", "1ms")),
    "minus sign of a typesetter, space before the value": Sound(lambda t: t.assign(**{"TI_5 [degC]": "− 3"})),
    "text for a bad value": Sound(put("AI_401.PV [%]", 5, "Bad Input"), missing=(4,)),
    "number for a bad value": Sound(put("AI_401.PV [%]", 5, -9999.0), missing=(4,)),
    "a spreadsheet's error for a bad value": Sound(put("AI_401.PV [%]", 5, "#N/A"), missing=(4,)),
    "an input with a bad value is held": Sound(put("FIC_102.PV [L/min]", 5, "I/O Timeout")),
    "an empty cell": Sound(put("AI_401.PV [%]", 9, ""), missing=(8,)),
    "newest first": Sound(lambda t: t.iloc[::-1]),
    "unsorted": Sound(lambda t: t.sample(frac=1, random_state=1)),
    "rows twice": Sound(lambda t: pd.concat([t, t.iloc[10:20]])),
    "a row corrected by a later one": Sound(lambda t: pd.concat([put("AI_401.PV [%]", 9, 99.0)(t), t.iloc[9:10]])),
    "a clock that jumped to 1970": Sound(put("Timestamp", 9, "1970-01-01 00:00:00"), missing=(8,)),
    "a clock that jumped to 2099": Sound(put("Timestamp", 9, "2099-01-01 00:00:00"), missing=(8,)),
    "empty columns and blank lines": Sound(
        lambda t: t.assign(Empty=""), lines(lambda ls: [*ls[:4], "", *ls[4:], "", ""])
    ),
    "units behind the values": Sound(
        lambda t: t.assign(**{c: [f"{v:.10g} {c.split('[')[1][:-1]}" for v in t[c]] for c in SHORT}).set_axis(
            [c.split(" [")[0] for c in t.columns], axis=1
        )
    ),
    "no units: by the size of the values": Sound(lambda t: t.set_axis([c.split(" [")[0] for c in t.columns], axis=1)),
    "names in German": Sound(
        lambda t: t.set_axis(
            [
                "Zeit",
                "Luft Durchfluss [L/min]",
                "Aufgabe Durchfluss [L/min]",
                "Niveau Sollwert [mm]",
                "Konzentrat Gehalt [%]",
            ],
            axis=1,
        )
    ),
    "quality beside the tag": Sound(
        lambda t: t.assign(**{"AI_401.PV.Status": np.where(np.arange(len(t)) == 12, "Bad", "Good")}).rename(
            columns={"AI_401.PV [%]": "AI_401.PV"}
        ),
        missing=(11,),
    ),
}


def _prefixed(file: Path, start: str) -> Path:
    file.write_text(start + file.read_text())
    return file


def record(sound: Sound, folder: Path, model: Model) -> pd.DataFrame:
    file = sound.write(sound.change(PLANT.columns()), folder)
    before = file.read_bytes()
    given = folder / "given.yaml"
    given.write_text(sound.given)
    table = import_table(file, model, load_tag_map(given) if sound.given else TagMap()).table()
    assert file.read_bytes() == before
    return table


@pytest.mark.parametrize("name", SOUND)
def test_a_sound_export_comes_through_with_the_right_numbers(name: str, tmp_path: Path, model: Model) -> None:
    sound = SOUND[name]
    table = record(sound, tmp_path, model)
    truth = PLANT.truth()
    grade = truth["concentrate_grade"].to_numpy().copy()
    grade[list(sound.missing)] = np.nan
    assert len(table) == len(truth)
    np.testing.assert_allclose(table["time_s"], 10.0 * np.arange(len(truth)), atol=1e-9)
    for column in ("air_flow_m3_s", "level_setpoint_m", "feed_flow_m3_s"):
        np.testing.assert_allclose(table[column], truth[column], rtol=1e-8, err_msg=column)
    np.testing.assert_allclose(table["concentrate_grade"], grade, rtol=1e-8)
    shift = pd.Timedelta(hours=sound.zone_h)
    assert list(table["time_utc"].dt.tz_localize(None) - shift) == list(truth.index)


@dataclass(frozen=True)
class Refused:
    """An export that is refused, and what must be said."""

    said: str
    change: Change = same
    write: Callable[[pd.DataFrame, Path], Path] = CSV
    given: str = ""


REFUSED = {
    "day or month first": Refused(
        "04/03/2026 has the day or the month first; say which in a map (--map): 'time: {format: day-first}'",
        lambda t: t.assign(Timestamp=(PLANT.stamps - pd.Timedelta("10D")).strftime("%d/%m/%Y %H:%M:%S")),
    ),
    "decimal or thousands": Refused(
        "'1,234' in line 2 is a number with decimals, or with thousands",
        lambda t: t.assign(**{c: "1,234" for c in SHORT}),
        to_text(separator=";"),
    ),
    "decimal comma and point": Refused(
        "a decimal comma; export it with one of them", put("AI_401.PV [%]", 3, "23,5"), to_text(separator=";")
    ),
    "two sheets": Refused(
        "2 sheets hold tables; say which in a map (--map): 'file: {sheet: A}'", write=to_book(("A", "B"))
    ),
    "two columns of times": Refused("2 columns hold times", lambda t: t.assign(Server=t["Timestamp"])),
    "no column of times": Refused("no column of times found", lambda t: t.drop(columns="Timestamp")),
    "time counts nobody knows what": Refused(
        "is a number that may count several things", lambda t: t.assign(Timestamp=10.0 * np.arange(len(t)))
    ),
    "month and day change places": Refused(
        "day and month change places",
        lambda t: stamped("%d/%m/%Y %H:%M:%S")(t).pipe(put("Timestamp", 9, "03/14/2026 06:01:30")),
    ),
    "a time that is none": Refused("line 11: the time 'yesterday' is no time", put("Timestamp", 9, "yesterday")),
    "31st of April": Refused("is no time of any calendar", put("Timestamp", 9, "2026-04-31 06:00:00")),
    "two tags for one quantity": Refused(
        "air_flow: the tags 'Air flow A' and 'Air flow B' suit equally well",
        lambda t: t.rename(columns={SHORT[0]: "Air flow A [L/min]"}).assign(**{"Air flow B [L/min]": 90.0}),
    ),
    "an input is not there": Refused(
        "no tag found for the input level_setpoint [m]", lambda t: t.drop(columns="LIC_201.SP [mm]")
    ),
    "a header twice": Refused(
        "the tag 'FIC_101.PV' is there twice", write=lines(lambda ls: [ls[0].replace("102", "101"), *ls[1:]])
    ),
    "gas at normal conditions": Refused(
        "air_flow: tag 'FIC_101.PV': unit 'Nm3/h' counts gas at normal conditions",
        lambda t: t.rename(columns={SHORT[0]: "FIC_101.PV [Nm3/h]"}),
    ),
    "no unit that fits": Refused(
        "level_setpoint: tag 'Level setpoint' names no unit, and its median 4000 fits none",
        lambda t: t.drop(columns=SHORT[2]).assign(**{"Level setpoint": 4000.0}),
    ),
    "a fraction said, percent meant": Refused(
        "in % it would be 0.23", lambda t: t.rename(columns={SHORT[3]: "Concentrate grade [-]"})
    ),
    "metres said, millimetres meant": Refused(
        "in mm it would be 0.38", lambda t: t.rename(columns={SHORT[2]: "LIC_201.SP [m]"})
    ),
    "map and header differ": Refused(
        "is in L/min by the file and in m3/h by the map", given="air_flow: {tag: FIC_101.PV, unit: m3/h}"
    ),
    "map gives a unit of something else": Refused(
        "concentrate_grade: tag 'AI_401.PV': unit 'mm' can not be converted to '-'",
        lambda t: t.rename(columns={SHORT[3]: "AI_401.PV"}),
        given="concentrate_grade: {tag: AI_401.PV, unit: mm}",
    ),
    "a single row": Refused("tag 'FIC_101.PV' has 1 value; a record needs at least 2", lambda t: t.iloc[:1]),
    "map names no tag of the file": Refused(
        "air_flow: no tag 'FIC_1O1.PV'; did you mean 'FIC_101.PV'", given="air_flow: {tag: FIC_1O1.PV, unit: L/min}"
    ),
    "map names no column of the file": Refused(
        "no column 'Time stamp' for the time; did you mean 'Timestamp'", given="time: {column: Time stamp}"
    ),
    "a text that the map does not know": Refused(
        "line 7: 'Bad Input' is no number (1 in all); if it stands for no value, add it to the map: bad: [Bad Input]",
        put("AI_401.PV [%]", 5, "Bad Input"),
        given="concentrate_grade: {tag: AI_401.PV, unit: '%', bad: [-9999]}",
    ),
    "a gap where none is wanted": Refused(
        "a gap: from 2026-03-14 06:04:20 on", lambda t: t.drop(index=range(24, 40)), given="grid: {gaps: refuse}"
    ),
    "never all inputs at once": Refused(
        "no time at which all inputs are known",
        lambda t: t.assign(
            **{SHORT[0]: t[SHORT[0]].where(t.index < 20, ""), SHORT[1]: t[SHORT[1]].where(t.index > 40, "")}
        ),
        given="grid: {step: 10 s, hold_at_most: 30 s}",
    ),
    "a row with more cells": Refused(
        "line 62 has more cells than the header", write=lambda t, folder: _longer(to_text()(t, folder))
    ),
    "no header": Refused("no header above line 1", write=lines(lambda ls: ls[1:])),
    "a header but no rows": Refused("no rows with a time and values", lambda t: t.iloc[:0]),
    "empty": Refused("the file is empty", write=exports.raw_bytes(b" \n")),
    "a picture": Refused("no text that can be read", write=exports.raw_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" * 20)),
    "an old spreadsheet": Refused("save it as .xlsx or CSV", write=exports.raw_bytes(b"\xd0\xcf", "export.xls")),
    "a spreadsheet that is none": Refused(
        "not a spreadsheet that can be read", write=exports.raw_bytes(b"x", "export.xlsx")
    ),
    "clock set back, no zone": Refused(
        "the clock goes back by an hour",
        lambda t: t.assign(
            Timestamp=pd.date_range("2025-10-26 00:55", periods=len(t), freq="10s", tz="UTC")
            .tz_convert("Europe/London")
            .strftime("%Y-%m-%d %H:%M:%S")
        ),
    ),
    "a time that the clock skipped": Refused(
        "does not exist in Europe/London",
        lambda t: t.assign(Timestamp=pd.date_range("2026-03-29 00:55", periods=len(t), freq="10s").astype(str)),
        given="time: {zone: Europe/London}",
    ),
}


def _longer(file: Path) -> Path:
    written = file.read_text().splitlines()
    file.write_text("\n".join([*written, written[-1] + ",9,9"]))
    return file


@pytest.mark.parametrize("name", REFUSED)
def test_an_unclear_or_broken_export_is_refused_with_the_right_words(name: str, tmp_path: Path, model: Model) -> None:
    case = REFUSED[name]
    sound = Sound(case.change, case.write, case.given)
    with pytest.raises(AdaptiveFlotError) as caught:
        record(sound, tmp_path, model)
    message = str(caught.value)
    assert case.said in message, message
    assert "export." in message.split(":")[0] and len(message.splitlines()) == 1 and len(message) < 600


@pytest.mark.parametrize("mark", [";", "\t", "|"])
def test_a_decimal_comma_in_every_cell_is_no_separator(mark: str, tmp_path: Path, model: Model) -> None:
    """Commas cut such lines as evenly as the separator, into one cell more."""
    truth = PLANT.truth()
    table = truth.reset_index(drop=True).assign(time_s=np.arange(len(truth)) * 10.0)
    file = tmp_path / "export.csv"
    table.to_csv(file, index=False, sep=mark, decimal=",", float_format="%.7f")
    found = import_table(file, model, TagMap())
    np.testing.assert_allclose(found.table()[truth.columns], truth, rtol=1e-5)


def test_what_is_done_with_the_times_is_said(tmp_path: Path, model: Model) -> None:
    """Inputs of a record act up to their row, those of an export from their stamp on; neither goes without a word."""
    truth = PLANT.truth().reset_index(drop=True)
    record = truth.assign(time_s=np.arange(len(truth)) * 10.0)
    renamed = record.rename(columns={"air_flow_m3_s": "airflow"})
    says = {
        "a record already: an input acts up to its row": (record, len(record)),
        "no record yet, as it has no column 'air_flow_m3_s': an input acts from its stamp on": (
            renamed,
            len(record) - 1,
        ),
        "rows that were not in the order of time: sorted": (record[::-1], len(record)),
        "an input acts from its stamp on": (PLANT.columns(), len(record)),
    }
    for said, (table, rows) in says.items():
        table.to_csv(tmp_path / "export.csv", index=False)
        found = import_table(tmp_path / "export.csv", model, TagMap())
        assert sum(words.startswith(said) for words in found.export.found) == 1, found.export.found
        assert len(found.table()) == rows, said
        assert sum("order of time" in words for words in found.export.found) == ("sorted" in said)


def test_there_are_thirty_of_them() -> None:
    assert len(SOUND) >= 30 and len(REFUSED) >= 30
