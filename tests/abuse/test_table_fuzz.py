"""Random damage to sound tables: they are read, or refused in one line; never a traceback, never a file left behind."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.errors import AdaptiveFlotError
from adaptive_flot.greybox.data.columns import LARGEST
from adaptive_flot.greybox.data.dataset import read_dataset
from tests.abuse.records import GOOD, PUBLISHED, TANK, one_line

CELLS = ["", " ", "nan", "inf", "-inf", "1e400", "1e300", "-1", "True", "x", "[bold]", "<script>", "1,5", '"', "'",
         "\x00", "\ufeff", "9" * 400, "0x1F", "1e-320", "2024-01-01", "\n", "\r", "$\\frac", "\u202e", "#"]  # fmt: skip


@settings(max_examples=60)
@given(data=st.data())
@pytest.mark.parametrize("process", ["tank", *PUBLISHED])
def test_damaged_csv_is_read_or_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, process: str, data: st.DataObject
) -> None:
    """Cells replaced, columns dropped or doubled, rows shuffled or cut, bytes flipped: numbers or one line, no file."""
    table = GOOD if process == "tank" else PUBLISHED[process][1]
    rows = [line.split(",") for line in table.to_csv(index=False).splitlines()]
    for _ in range(data.draw(st.integers(1, 3))):
        i = data.draw(st.integers(0, len(rows) - 1))
        j = data.draw(st.integers(0, min(map(len, rows)) - 1))
        how = data.draw(st.sampled_from(["cell", "drop", "double", "swap", "cut"]))
        if how == "cell":
            rows[i][j] = data.draw(st.sampled_from(CELLS))
        elif how == "drop" and min(map(len, rows)) > 1:
            rows = [[*row[:j], *row[j + 1 :]] for row in rows]
        elif how == "double":
            rows = [[*row, row[j]] for row in rows]
        elif how == "swap":
            rows[0 if i else -1], rows[i] = rows[i], rows[0 if i else -1]
        elif how == "cut":
            rows = rows[: i + 1]
    raw = bytearray("\n".join(",".join(row) for row in rows).encode())
    if data.draw(st.booleans()) and raw:
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    read_or_one_line(tmp_path_factory.getbasetemp() / f"fuzz_{process}", "record.csv", bytes(raw), process)


@settings(max_examples=100)
@given(data=st.data())
def test_damaged_parquet_is_read_or_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    """Bytes flipped, the file cut: a reader in C++ must not take the process with it."""
    stream = io.BytesIO()
    GOOD.to_parquet(stream, index=False)
    raw = bytearray(stream.getvalue())
    for _ in range(data.draw(st.integers(1, 4))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    raw = raw[: data.draw(st.sampled_from([len(raw), len(raw) // 2, len(raw) - 3]))]
    read_or_one_line(tmp_path_factory.getbasetemp() / "fuzz_parquet", "record.parquet", bytes(raw), "tank")


def read_or_one_line(folder: Path, name: str, raw: bytes, process: str) -> None:
    folder.mkdir(exist_ok=True)
    file = folder / name
    file.write_bytes(raw)
    try:
        if process == "tank":
            record = read_dataset(file, TANK)
            assert np.isfinite(record.inputs).all() and np.nanmax(np.abs(record.outputs), initial=0) <= LARGEST
        else:
            PUBLISHED[process][0](file)
    except AdaptiveFlotError as error:
        one_line(str(error), file)
    assert [f.name for f in folder.iterdir()] == [name]
