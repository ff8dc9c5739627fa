"""Tables that nobody should write: each gives one line of error with the file, or the numbers it means."""

from __future__ import annotations

import gzip
import io
import lzma
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.errors import OutputError
from adaptive_flot.greybox.data.dataset import read_dataset
from adaptive_flot.greybox.data.tables import MOST_ROWS, read_table, write_table
from tests.abuse.records import GOOD, TANK, N, refusal
from tests.cli.conftest import Call

CLOCK = pd.Timestamp("2024-03-01 12:00") + pd.to_timedelta(GOOD["time_s"], unit="s")
LONG_TEXT = pd.concat([GOOD] * 200).to_csv(index=False).encode()


def packed(content: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("a.csv", content)
        archive.writestr("b.csv", content)
    return stream.getvalue()


# -- columns that are no numbers ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
@pytest.mark.parametrize(
    ("column", "values", "part"),
    [
        ("level_m", GOOD["level_m"] > 2, "'level_m' holds true and false; write numbers"),
        ("inflow_m3_s", [True, False, None] * 2, "'inflow_m3_s' holds true and false; write numbers"),
        ("time_s", [True] * N, "'time_s' holds true and false"),
        ("k", [True] * N, "'k' holds true and false"),
        ("level_m", [*GOOD["level_m"][:-1], -np.inf], "'level_m', line 7: -inf is no measured value (1 in all)"),
        ("inflow_m3_s", [np.inf] * N, "'inflow_m3_s', line 2: inf is no measured value (6 in all)"),
        ("level_m", [3.4e38] * N, "line 2: 3.4e+38 is no measured value"),
        ("time_s", 1e300 * np.arange(N), "'time_s', line 3: 1e+300 is no measured value"),
        ("time_s", [1e300] * N, "'time_s', line 2: 1e+300 is no measured value"),
        ("level_m", ["9" * 10_000] * N, "'level_m', line 2: '9999"),
        ("level_m", ["[bold]", *"12345"], "line 2: '[bold]' is not a number"),
        ("level_m", ["1\x002", *"12345"], "line 2: '1\\x002' is not a number"),
        ("level_m", ["1+2j"] * N, "'1+2j' is not a number"),
    ],
)
def test_column_that_holds_no_numbers_is_refused(
    tmp_path: Path, suffix: str, column: str, values: Any, part: str
) -> None:
    file = tmp_path / f"record{suffix}"
    write_table(GOOD.assign(**{column: values}), file)
    assert part in refusal(lambda: read_dataset(file, TANK), file)


@pytest.mark.parametrize(
    ("values", "part"),
    [
        ([b"1"] * N, "holds binary data"),
        (CLOCK, "holds dates"),
        (CLOCK.dt.date, "holds dates"),
        (CLOCK - CLOCK[0], "holds durations"),
        (CLOCK.dt.time, "holds times of day"),
        ([[1.0]] * N, "line 2: array([1.]) is not a number"),
        ([{"a": 1}] * N, "line 2: {'a': 1} is not a number"),
        (pd.Categorical(["low", "high"] * 3), "line 2: 'low' is not a number"),
    ],
)
def test_column_of_a_kind_that_only_parquet_has_is_refused(tmp_path: Path, values: Any, part: str) -> None:
    file = tmp_path / "record.parquet"
    write_table(GOOD.assign(level_m=values), file)
    assert part in refusal(lambda: read_dataset(file, TANK), file)


@pytest.mark.parametrize(
    "clock",
    [CLOCK, CLOCK.dt.tz_localize("UTC"), CLOCK.astype("datetime64[ms]"), CLOCK - CLOCK[0]],
    ids=["date", "with time zone", "in ms", "duration"],
)
@pytest.mark.parametrize("as_index", [False, True])
def test_dates_and_durations_become_seconds(tmp_path: Path, clock: pd.Series, as_index: bool) -> None:
    """Seconds since the first row, also where pandas wrote the time as index; the numbers stay what they are."""
    file = tmp_path / "record.parquet"
    table = GOOD.assign(time_s=clock)
    (table.set_index("time_s") if as_index else table).to_parquet(file)
    record = read_dataset(file, TANK)
    np.testing.assert_array_equal(record.time, GOOD["time_s"])
    np.testing.assert_array_equal(record.outputs[:, 0], GOOD["level_m"])
    assert record.dt == 2.0


def test_a_date_that_is_missing_is_an_empty_time(tmp_path: Path) -> None:
    file = tmp_path / "record.parquet"
    GOOD.assign(time_s=CLOCK.where(CLOCK.index != 2)).to_parquet(file)
    assert "'time_s' is empty in line 4" in refusal(lambda: read_dataset(file, TANK), file)


def test_columns_of_other_numeric_kinds_are_read(tmp_path: Path) -> None:
    """Integers with gaps and categories of numbers mean what they say."""
    file = tmp_path / "record.parquet"
    level = pd.array([1, None, 2, 3, 4, 5], dtype="Int64")
    GOOD.assign(level_m=level, k=pd.Categorical([0.5, 0.25] * 3)).to_parquet(file)
    record = read_dataset(file, TANK)
    np.testing.assert_array_equal(record.outputs[:, 0], [1, np.nan, 2, 3, 4, 5])
    np.testing.assert_array_equal(record.parameters["discharge"], [0.5, 0.25] * 3)


# -- times -------------------------------------------------------------------------------------------------------------


def test_record_that_takes_too_many_steps_is_refused(tmp_path: Path) -> None:
    """The tank steps a second at most: 1e7 s apart it would step for hours."""
    file = tmp_path / "record.csv"
    write_table(GOOD.assign(time_s=1e7 * np.arange(N)), file)
    message = refusal(lambda: read_dataset(file, TANK), file)
    assert "6 rows, 1e+07 s apart, take 5e+07 steps of model 'tank', whose longest is 1 s" in message


@pytest.mark.parametrize("dt", [3600.0, 86400.0])
def test_a_long_interval_is_read_where_the_steps_are_few(tmp_path: Path, dt: float) -> None:
    file = tmp_path / "record.csv"
    write_table(GOOD.assign(time_s=dt * np.arange(N)), file)
    assert read_dataset(file, TANK).dt == dt


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_table_of_too_many_rows_is_refused(tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"record{suffix}"
    table = pd.DataFrame({"time_s": np.zeros(MOST_ROWS + 1, dtype=np.int8)})
    table.to_parquet(file) if suffix == ".parquet" else file.write_text("time_s\n" + "0\n" * len(table))
    assert f"more than {MOST_ROWS} rows" in refusal(lambda: read_table(file), file)


# -- files -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "content", "part"),
    [
        ("a.csv.gz", gzip.compress(LONG_TEXT, mtime=0)[:-100], "not a readable table (Compressed file ended"),
        ("a.csv.gz", gzip.compress(LONG_TEXT, mtime=0)[:15], "not a readable table"),
        ("a.csv.gz", b"no gzip", "not a readable table"),
        ("a.csv.xz", lzma.compress(LONG_TEXT)[:-100], "not a readable table (Compressed file ended"),
        ("a.csv.xz", b"no xz", "not a readable table"),
        ("a.csv.bz2", b"no bz2", "not a readable table"),
        ("a.csv.zip", b"no zip", "not a readable table"),
        ("a.csv.zip", packed(LONG_TEXT), "not a readable table"),
        ("a.csv.tar", b"no tar", "not a readable table"),
        ("a.csv.zst", b"no zst", "not a readable table"),
        ("a.xlsx", packed(LONG_TEXT), "a spreadsheet; make a record of it with `adaptive-flot import`"),
        ("a.csv", "time_s,level_m\n0,1\n".encode("utf-16"), "not a text in UTF-8"),
        ("a.PARQUET", LONG_TEXT, "not a readable table"),
        ("a.parquet", b"PAR1" + bytes(40) + b"PAR1", "not a readable table"),
        ("a.csv", b"time_s,inflow_m3_s,level_m\n0,0.1,1\n2,\"0.1,1\n", "not a readable table"),
        ("a.csv", b"time_s,level_m,level_m\n0,0.1,1\n2,0.1,1\n", "column 'level_m' is there twice"),
        ("a.csv", b"time_s,in\x00flow,level_m\n0,0.1,1\n2,0.1,1\n", "the name of column 2, 'in\\x00flow', can not"),
        ("a.csv", b"time_s,\x1b[31mred,level_m\n0,0.1,1\n2,0.1,1\n", "the name of column 2"),
        ("a.csv", b"x" * 100_000, "a header but no rows"),
    ],
)  # fmt: skip
def test_damaged_file_is_refused(tmp_path: Path, name: str, content: bytes, part: str) -> None:
    file = tmp_path / name
    file.write_bytes(content)
    assert part in refusal(lambda: read_table(file), file)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_table_that_may_not_be_read_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str) -> None:
    """Simulated, because an administrator may read every file: the folder's permission, then the file's."""
    file = tmp_path / f"record{suffix}"
    write_table(GOOD, file)

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    for target, name in ((pd, "read_csv"), (pd, "read_parquet"), (Path, "is_file")):
        monkeypatch.setattr(target, name, refuse)
        if name != "read_csv" or suffix == ".csv":
            assert "can not be read (Permission denied)" in refusal(lambda: read_table(file), file)


def test_link_to_nothing_is_no_file(tmp_path: Path) -> None:
    link = tmp_path / "record.csv"
    link.symlink_to(tmp_path / "nowhere.csv")
    assert "no such file" in refusal(lambda: read_table(link), link)


@pytest.mark.parametrize("name", ["t.xlsx", "t.csv.gz", "t.csv.zip", "t.txt", "t", "t.parquet.gz", "t.pq"])
def test_table_is_not_written_under_a_name_that_says_otherwise(tmp_path: Path, name: str) -> None:
    with pytest.raises(OutputError, match=r"a table is written as \.csv or \.parquet"):
        write_table(GOOD, tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_simulate_refuses_such_a_name_before_any_work(call: Call, tmp_path: Path) -> None:
    """The table of inputs, which is not one, is not even read."""
    (tmp_path / "inputs.csv").write_text("no table")
    result = call("simulate", "inputs.csv", "--out", "t.xlsx")
    assert (result.code, result.out) == (2, "")
    assert "t.xlsx: a table is written as .csv or .parquet" in result.err
    assert [f.name for f in tmp_path.iterdir()] == ["inputs.csv"]


@pytest.mark.parametrize(("name", "magic"), [("t.PARQUET", b"PAR1"), ("t.CSV", b"time_s,")])
def test_table_is_what_its_suffix_says_in_any_case(tmp_path: Path, name: str, magic: bytes) -> None:
    write_table(GOOD, tmp_path / name)
    assert (tmp_path / name).read_bytes().startswith(magic)
    np.testing.assert_array_equal(read_table(tmp_path / name), GOOD)
