"""Measured records: what is read, and that every fault in a file has one message with what, where, got and do."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from adaptive_flot.errors import DataError, RangeError
from adaptive_flot.greybox.data.dataset import Dataset, read_dataset
from adaptive_flot.greybox.data.tables import write_table
from adaptive_flot.greybox.model import FloatArray, Model, Parameter, Quantity, Scope

HEADER = "time_s,inflow_m3_s,level_m,outflow_m3_s"
ROWS = ("0,0.1,1.0,0.1", "2,0.2,1.1,0.2", "4,0.3,1.2,0.3", "6,0.4,1.3,0.4")


def _equations(m: Scope) -> None:
    outflow = m.parameter("discharge") * m.state("depth")
    m.derivative("depth", m.input("inflow") - outflow)
    m.output("level", m.state("depth"))
    m.output("outflow", outflow)


TANK = Model(
    name="tank",
    states=(Quantity("depth", "m", ""),),
    inputs=(Quantity("inflow", "m3/s", "", 0.0, 1.0),),
    parameters=(Parameter("discharge", 0.5, "m2/s", "", symbol="k"),),
    outputs=(Quantity("level", "m", ""), Quantity("outflow", "m3/s", "")),
    equations=_equations,
)
Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write a table of lines; returns its path."""

    def to_file(*lines: str) -> Path:
        file = tmp_path / "record.csv"
        file.write_text("\n".join(lines) + "\n")
        return file

    return to_file


def same(a: Dataset, b: Dataset) -> bool:
    return all(np.array_equal(getattr(a, n), getattr(b, n), equal_nan=True) for n in ("time", "inputs", "outputs"))


# -- what is read ------------------------------------------------------------------------------------------------------


def test_columns_are_found_by_name_in_any_order(write: Write) -> None:
    """Order in the file, spaces after a comma and columns of no interest make no difference."""
    plain = read_dataset(write(HEADER, *ROWS), TANK)
    assert (plain.name, plain.dt, len(plain)) == ("record", 2.0, 4)
    np.testing.assert_array_equal(plain.time, [0, 2, 4, 6])
    np.testing.assert_array_equal(plain.inputs, [[0.1], [0.2], [0.3], [0.4]])
    np.testing.assert_array_equal(plain.outputs, [[1.0, 0.1], [1.1, 0.2], [1.2, 0.3], [1.3, 0.4]])
    assert plain.initial_state is None
    assert not plain.parameters
    columns = [line.split(",") for line in (HEADER, *ROWS)]
    turned = write(*(", ".join([*reversed(c), "remark"]) for c in columns))
    assert same(read_dataset(turned, TANK), plain)


finite = st.floats(-1e6, 1e6, allow_subnormal=False)


@given(
    outputs=arrays(float, (5, 2), elements=st.one_of(finite, st.just(np.nan))),
    inputs=arrays(float, (5, 1), elements=st.floats(0, 1, allow_subnormal=False)),
    start=st.floats(-1e4, 1e4),
    dt=st.floats(0.1, 3600.0),
)
@pytest.mark.parametrize(("suffix", "precision"), [(".csv", 1e-11), (".parquet", 0.0)])
def test_round_trip_keeps_the_numbers_and_the_gaps(
    tmp_path_factory: pytest.TempPathFactory,
    suffix: str,
    precision: float,
    outputs: FloatArray,
    inputs: FloatArray,
    start: float,
    dt: float,
) -> None:
    """Parquet to the bit, CSV to 12 digits; NaN outputs stay NaN and no other value becomes one."""
    file = tmp_path_factory.getbasetemp() / f"trip{suffix}"
    time = start + dt * np.arange(5)
    columns = HEADER.split(",")
    write_table(pd.DataFrame(np.column_stack([time, inputs, outputs]), columns=columns), file)
    found = read_dataset(file, TANK)
    np.testing.assert_allclose(found.outputs, outputs, rtol=precision)
    np.testing.assert_allclose(found.inputs, inputs, rtol=precision)
    np.testing.assert_allclose(found.time, time, rtol=precision, atol=precision)
    assert found.dt == pytest.approx(dt, rel=1e-6)


def test_missing_outputs_are_nan(write: Write) -> None:
    """Empty cells, NaN by name and columns that are not there; `measured` lists what has at least one value."""
    record = read_dataset(write("time_s,inflow_m3_s,level_m", "0,0.1,", "2,0.2,NaN", "4,0.3,1.2"), TANK)
    np.testing.assert_array_equal(record.outputs, [[np.nan, np.nan], [np.nan, np.nan], [1.2, np.nan]])
    assert record.measured(TANK) == ("level",)


def test_parameters_answer_to_name_and_symbol(write: Write) -> None:
    for label in ("k", "discharge"):
        record = read_dataset(write(f"{HEADER},{label}", *(f"{row},0.{i + 5}" for i, row in enumerate(ROWS))), TANK)
        np.testing.assert_array_equal(record.parameters["discharge"], [0.5, 0.6, 0.7, 0.8])


@pytest.mark.parametrize(("first", "found"), [("1.5", [1.5]), ("", None)])
def test_initial_state_is_that_of_the_first_row(write: Write, first: str, found: list[float] | None) -> None:
    record = read_dataset(write(f"{HEADER},depth_m", f"{ROWS[0]},{first}", *(f"{row},9" for row in ROWS[1:])), TANK)
    assert (record.initial_state is None) if found is None else np.array_equal(record.initial_state or [], found)


def test_part_of_a_record_keeps_what_belongs_to_it(write: Write) -> None:
    """Rows, parameters and, only where row 0 is part of it, the initial state."""
    record = read_dataset(write(f"{HEADER},depth_m,k", *(f"{row},9,0.5" for row in ROWS)), TANK)
    part = record.rows(1, 3)
    np.testing.assert_array_equal(part.time, [2, 4])
    np.testing.assert_array_equal(part.outputs, record.outputs[1:3])
    np.testing.assert_array_equal(part.inputs, record.inputs[1:3])
    assert len(part.parameters["discharge"]) == len(part) == 2
    assert part.initial_state is None
    assert record.rows(0, 2).initial_state is not None


# -- what is refused ---------------------------------------------------------------------------------------------------


def changed(line: int, text: str) -> tuple[str, ...]:
    """The good table with one line (as an editor counts them) replaced."""
    lines = [HEADER, *ROWS]
    lines[line - 1] = text
    return tuple(lines)


@pytest.mark.parametrize(
    ("column", "said"),
    [
        ("outflw_m3_s", ("outflow is not measured: there is no column 'outflow_m3_s'; 'outflw_m3_s' is not used",)),
        ("outflow_m3_s_true", ()),
        ("density_kg_m3", ()),
    ],
)
def test_an_output_is_not_lost_by_a_slip_of_the_pen_unseen(write: Write, column: str, said: tuple[str, ...]) -> None:
    assert read_dataset(write(f"time_s,inflow_m3_s,level_m,{column}", *ROWS), TANK).notes == said


@pytest.mark.parametrize(
    ("lines", "parts"),
    [
        (changed(1, "time_s,inflo_m3_s,level_m,outflow_m3_s"), ("'inflow_m3_s' is missing", "mean 'inflo_m3_s'")),
        (changed(1, "t,inflow_m3_s,level_m,outflow_m3_s"), ("'time_s' is missing", "add it")),
        (changed(1, "time_min,inflow_m3_s,level_m,outflow_m3_s"), ("'time_min' has the wrong unit", "'time_s'")),
        (changed(1, "time_s,inflow_m3_h,level_m,outflow_m3_s"),
         ("'inflow_m3_h' has the wrong unit", "by 0.000277778 and name it 'inflow_m3_s'")),
        (changed(1, "time_s,inflow,level_m,outflow_m3_s"), ("'inflow' has the wrong unit", "name it 'inflow_m3_s'")),
        (changed(1, "time_s,inflow_m3_s,level_cm,outflow_m3_s"),
         ("'level_cm' has the wrong unit", "by 0.01 and name it 'level_m'")),
        (changed(1, "time_s,inflow_m3_s,level_m,outflow_mol_s"),
         ("'outflow_mol_s' has the wrong unit", "'outflow_m3_s'")),
        (changed(3, "2,,1.1,0.2"), ("input 'inflow_m3_s' has no value in line 3", "1 in all", "fill in")),
        (changed(4, "4,inf,1.1,0.2"), ("'inflow_m3_s', line 4: inf is no measured value", "correct it")),
        (changed(4, "4,0.1,high,0.2"), ("column 'level_m', line 4: 'high' is not a number", "correct it")),
        (changed(2, "noon,0.1,1.0,0.1"), ("column 'time_s', line 2: 'noon' is not a number", "correct it")),
        (changed(3, ",0.2,1.1,0.2"), ("'time_s' is empty in line 3", "give the time")),
        (changed(4, "2,0.3,1.2,0.3"), ("time does not increase in line 4 (2 s, then 2 s)", "sort")),
        (changed(4, "1,0.3,1.2,0.3"), ("time does not increase in line 4 (2 s, then 1 s)", "sort")),
        (changed(5, "9,0.4,1.3,0.4"), ("time is not uniform: 5 s before line 5, 2 s elsewhere", "-flot import")),
        ((HEADER, ROWS[0]), ("1 row", "at least 2")),
        ((HEADER,), ("a header but no rows", "give a table with rows")),
        ((f"{HEADER},k", *(f"{row},{k}" for row, k in zip(ROWS, ("1", "1", "", "1"), strict=True))),
         ("parameter 'discharge' is empty in line 4", "every row or in none")),
        (("a b c", "1 2", "3,4,5"), ("not a readable table", "give CSV or Parquet")),
    ],
)  # fmt: skip
def test_fault_is_named_in_one_line(write: Write, lines: tuple[str, ...], parts: tuple[str, ...]) -> None:
    file = write(*lines)
    with pytest.raises(DataError) as error:
        read_dataset(file, TANK)
    message = str(error.value)
    assert message.startswith(f"{file}: ")
    assert "\n" not in message
    assert all(part in message for part in parts), message


@pytest.mark.parametrize(
    ("name", "content", "part"),
    [
        ("a.csv", b"", "the file is empty"),
        ("a.csv", b"\n\n", "not a readable table"),
        ("a.csv", bytes(range(256)) * 8, "not a readable table"),
        ("a.csv", b"PK\x03\x04\x14\x00\x06\x00,\x01\n1,2\n", "not a text table"),
        ("a.csv", b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR", "not a text in UTF-8"),
        ("a.csv", "time_s,b\n1,2\n".encode("utf-16"), "not a text in UTF-8"),
        ("a.parquet", b"time_s,b\n1,2\n", "not a readable table"),
        ("a.parquet", b"", "the file is empty"),
    ],
)
def test_file_that_is_no_table_is_refused(tmp_path: Path, name: str, content: bytes, part: str) -> None:
    """Binary, wrongly named, wrongly encoded or empty: never a traceback, always the file and what to give."""
    file = tmp_path / name
    file.write_bytes(content)
    with pytest.raises(DataError) as error:
        read_dataset(file, TANK)
    assert str(error.value).startswith(f"{file}: {part}")
    assert "give" in str(error.value)


@pytest.mark.parametrize("name", ["none.csv", "."])
def test_path_that_is_no_file_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(DataError, match="no such file; give the path"):
        read_dataset(tmp_path / name, TANK)


def test_output_that_is_needed_must_be_there(write: Write) -> None:
    file = write("time_s,inflow_m3_s,level_m", "0,0.1,1.0", "2,0.2,1.1")
    read_dataset(file, TANK, required_outputs=["level"])
    with pytest.raises(DataError, match="column 'outflow_m3_s' is missing; add it"):
        read_dataset(file, TANK, required_outputs=["level", "outflow"])


def test_input_outside_its_range_is_refused(write: Write) -> None:
    """With file, input, value, time and range: most often a wrong unit."""
    file = write(*changed(4, "4,300,1.2,0.3"))
    with pytest.raises(RangeError, match=r"inflow = 300 m3/s at time 4 s .* \[0, 1\] m3/s; correct") as error:
        read_dataset(file, TANK)
    assert str(error.value).startswith(str(file))


@given(jitter=arrays(float, 20, elements=st.floats(-0.4, 0.4)))
def test_times_rounded_to_three_digits_count_as_uniform(
    tmp_path_factory: pytest.TempPathFactory, jitter: FloatArray
) -> None:
    """A clock that is off by less than 0.05 % of the interval is uniform; the interval is the mean one."""
    file = tmp_path_factory.getbasetemp() / "jitter.csv"
    time = 10.0 * np.arange(20) + 0.01 * jitter
    table = np.column_stack([time, np.full((20, 3), 0.5)])
    write_table(pd.DataFrame(table, columns=HEADER.split(",")), file)
    assert read_dataset(file, TANK).dt == pytest.approx((time[-1] - time[0]) / 19, rel=1e-9)


# -- known faults ------------------------------------------------------------------------------------------------------


def test_table_of_commas_only_is_refused(write: Write) -> None:
    with pytest.raises(DataError):
        read_dataset(write(",,", ",,"), TANK)


def test_rows_longer_than_the_header_are_refused(write: Write) -> None:
    """A decimal comma, say: silently cutting the row would shift or lose values."""
    with pytest.raises(DataError):
        read_dataset(write(HEADER, *(f"{row},7" for row in ROWS)), TANK)


def test_line_number_counts_blank_lines(write: Write) -> None:
    with pytest.raises(DataError, match="line 5"):
        read_dataset(write(HEADER, ROWS[0], "", ROWS[1], "4,0.3,high,0.3"), TANK)


def test_a_table_at_hand_is_read_like_its_file(tmp_path: Path) -> None:
    """A notebook has a DataFrame, with or without the time as its index: same record, same words on a mistake."""
    (tmp_path / "record.csv").write_text("\n".join((HEADER, *ROWS)))
    table = pd.read_csv(tmp_path / "record.csv")
    from_file = read_dataset(tmp_path / "record.csv", TANK)
    for source in (table, table.set_index("time_s"), table.set_axis([7, 8, 9, 10])):
        record = read_dataset(source, TANK)
        np.testing.assert_array_equal(record.time, from_file.time)
        np.testing.assert_array_equal(record.inputs, from_file.inputs)
        np.testing.assert_array_equal(record.outputs, from_file.outputs)
    with pytest.raises(DataError, match=r"^DataFrame: column 'inflow_m3_s' is missing"):
        read_dataset(table.drop(columns="inflow_m3_s"), TANK)
