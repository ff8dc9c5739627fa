"""Ugly exports, made here: one true plant, written as historians, loggers and spreadsheets write."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from adaptive_flot.greybox.model import FloatArray

ROWS = 60
STEP = 10.0
START = pd.Timestamp("2026-03-14 06:00:00")


@dataclass(frozen=True)
class Plant:
    """What really happened: inputs that acted from each stamp on, outputs at each stamp, in SI units."""

    stamps: pd.DatetimeIndex = field(default_factory=lambda: pd.date_range(START, periods=ROWS, freq="10s"))

    @property
    def air(self) -> FloatArray:
        """Air flow [m3/s], a step every 7 stamps."""
        return np.where(np.arange(len(self.stamps)) // 7 % 2, 1.5e-3, 1.2e-3)

    @property
    def feed(self) -> FloatArray:
        """Feed flow [m3/s]."""
        return np.where(np.arange(len(self.stamps)) // 11 % 2, 1.7e-4, 1.6e-4)

    @property
    def setpoint(self) -> FloatArray:
        """Level set-point [m]."""
        return np.where(np.arange(len(self.stamps)) // 20 % 2, 0.40, 0.38)

    @property
    def grade(self) -> FloatArray:
        """Concentrate grade [-]."""
        return 0.23 + 0.01 * np.sin(np.arange(len(self.stamps)) / 5)

    def truth(self) -> pd.DataFrame:
        """The record: row k has the inputs that acted since the stamp before, and the grade at its own."""
        return pd.DataFrame(
            {
                "air_flow_m3_s": self.air[:-1],
                "feed_flow_m3_s": self.feed[:-1],
                "level_setpoint_m": self.setpoint[:-1],
                "concentrate_grade": self.grade[1:],
            },
            index=self.stamps[1:],
        )

    def columns(self, form: str = "%Y-%m-%d %H:%M:%S") -> pd.DataFrame:
        """A tidy export: units in the header, values as plants give them."""
        return pd.DataFrame(
            {
                "Timestamp": self.stamps.strftime(form),
                "FIC_101.PV [L/min]": self.air * 60_000,
                "FIC_102.PV [L/min]": self.feed * 60_000,
                "LIC_201.SP [mm]": self.setpoint * 1000,
                "AI_401.PV [%]": self.grade * 100,
            }
        ).astype(object)


def long_form(table: pd.DataFrame) -> pd.DataFrame:
    """A row a value: Tag, Timestamp, Value, Quality."""
    tall = table.melt(id_vars="Timestamp", var_name="Tag", value_name="Value").assign(Quality="Good")
    return tall[["Tag", "Timestamp", "Value", "Quality"]]


def text(table: pd.DataFrame, separator: str = ",", decimal: str = ".", thousands: str = "") -> str:
    """CSV with 10 significant digits."""

    def cell(value: object) -> object:
        if not isinstance(value, float):
            return value
        shown = f"{value:,.10g}" if thousands else f"{value:.10g}"
        return shown.replace(",", "~").replace(".", decimal).replace("~", thousands)

    return table.map(cell).to_csv(index=False, sep=separator, lineterminator="\n")


def to_text(
    encoding: str = "utf-8", separator: str = ",", decimal: str = ".", thousands: str = ""
) -> Callable[[pd.DataFrame, Path], Path]:
    """Write a table as a text file."""

    def write(table: pd.DataFrame, folder: Path) -> Path:
        file = folder / "export.csv"
        file.write_bytes(text(table, separator, decimal, thousands).encode(encoding))
        return file

    return write


def lines(
    change: Callable[[list[str]], Sequence[str]], encoding: str = "utf-8"
) -> Callable[[pd.DataFrame, Path], Path]:
    """Write a table as a text file whose lines are changed."""

    def write(table: pd.DataFrame, folder: Path) -> Path:
        file = folder / "export.csv"
        file.write_bytes("\n".join(change(text(table).splitlines())).encode(encoding))
        return file

    return write


def to_book(sheets: Sequence[str] = ("Export",), *, dates: bool = True) -> Callable[[pd.DataFrame, Path], Path]:
    """Write a table as a spreadsheet, on each of the sheets."""

    def write(table: pd.DataFrame, folder: Path) -> Path:
        file = folder / "export.xlsx"
        typed = table.assign(Timestamp=pd.to_datetime(table["Timestamp"])) if dates else table
        with pd.ExcelWriter(file, engine="openpyxl") as book:
            for sheet in sheets:
                typed.to_excel(book, sheet_name=sheet, index=False)
        return file

    return write


def to_parquet(table: pd.DataFrame, folder: Path) -> Path:
    """Write a table as Parquet with its types."""
    file = folder / "export.parquet"
    table.assign(Timestamp=pd.to_datetime(table["Timestamp"])).infer_objects().to_parquet(file, index=False)
    return file


def gzipped(table: pd.DataFrame, folder: Path) -> Path:
    """Write a table as packed CSV."""
    file = folder / "export.csv.gz"
    table.to_csv(file, index=False, compression="gzip")
    return file


def raw_bytes(content: bytes, name: str = "export.csv") -> Callable[[pd.DataFrame, Path], Path]:
    """Write these bytes, whatever the table."""

    def write(table: pd.DataFrame, folder: Path) -> Path:
        del table
        file = folder / name
        file.write_bytes(content)
        return file

    return write


def reread(table: pd.DataFrame) -> pd.DataFrame:
    """A table as its CSV file would be read by pandas."""
    return pd.read_csv(io.StringIO(text(table)))
