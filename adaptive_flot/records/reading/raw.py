"""The cells of a file as they stand, and what is unclear about them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd
import yaml

from adaptive_flot.errors import DataError


class UnclearError(DataError):
    """Several readings of a file are equally good. The user chooses one: at the terminal, or by a line of a map.

    Attributes
    ----------
    question
        What is unclear, and where.
    section
        Section of the map, or quantity, where the answer stands.
    choices
        Readings to choose from, each as keys of the section.
    """

    def __init__(self, question: str, section: str, choices: Sequence[Mapping[str, str]]) -> None:
        written = " or ".join(f"'{map_line(section, keys)}'" for keys in choices[:3])
        super().__init__(f"{question}; say which in a map (--map): {written}")
        self.question, self.section, self.choices = question, section, tuple(choices)


def map_line(section: str, keys: Mapping[str, str]) -> str:
    """A line of a map.

    >>> map_line("file", {"decimal": ","})
    "file: {decimal: ','}"
    """
    return f"{section}: {yaml.safe_dump(dict(keys), default_flow_style=True, sort_keys=False, width=1000).strip()}"


@dataclass(frozen=True)
class RawTable:
    """A table without header: cells as they stand in the file.

    Attributes
    ----------
    file
        Where it comes from, for messages.
    cells
        Texts, "" where empty; columns numbered from 0; the index holds the lines of the file, from 1. Columns that the
        file itself holds as numbers or dates keep that type.
    point
        Whether numbers are known to be written with a decimal point, as those of a spreadsheet are.
    names
        Column names, where the file keeps them apart from the cells (Parquet); else empty.
    found
        What was found out about the file, in words.
    """

    file: Path
    cells: pd.DataFrame
    point: bool = False
    names: tuple[str, ...] = ()
    found: tuple[str, ...] = field(default=())

    def texts(self, column: int) -> pd.Series:
        """Cells of one column as stripped texts, "" where empty."""
        raw = self.cells[column]
        if not pd.api.types.is_string_dtype(raw.dtype):
            raw = raw.astype("string").fillna("")
        return raw.str.strip()
