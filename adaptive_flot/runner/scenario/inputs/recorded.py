"""Inputs of a scenario as they were recorded at a plant."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field, PrivateAttr, computed_field

from adaptive_flot import provenance
from adaptive_flot.errors import ScenarioError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.yaml_files.part import Part


class Recorded(Part):
    """An input of a measured record, held as it acted; the run begins with the first row.

    `file` is a record, or with `map` an export of a plant's historian. Both lie beside the scenario, or where the
    path says. Of a record in stretches the longest is played.
    """

    profile: Literal["record"]
    file: str = Field(exclude=True)
    map: str | None = Field(default=None, exclude=True)
    _held: FloatArray = PrivateAttr(default_factory=lambda: np.empty(0))
    _step: float = PrivateAttr(default=np.nan)
    _notes: tuple[str, ...] = PrivateAttr(default=())

    @computed_field  # type: ignore[prop-decorator]  # of pydantic: the values, and not their file, say what is run
    @property
    def values_sha256(self) -> str:
        """First digits of the hash of the values: what tells two runs apart, wherever the file lies."""
        return provenance.values_hash([self._held, np.array([self._step])])

    @property
    def duration_s(self) -> float:
        """How long the record is [s]."""
        return len(self._held) * self._step

    @property
    def said(self) -> str:
        """The record in words: file, rows, step, and what was left out of it."""
        rows = f"{Path(self.file).name}, {len(self._held) + 1} rows, one every {self._step:g} s"
        return "; ".join([rows, *self._notes])

    def of(self, record: Dataset, place: int) -> Recorded:
        """The same with the values of one input of a record.

        Parameters
        ----------
        record
            The record. The inputs of its first row acted before it begins, and are left out.
        place
            Index of the input.
        """
        read = self.model_copy()
        read._held, read._step, read._notes = record.inputs[1:, place].copy(), record.dt, record.notes
        return read

    def paths(self, folder: Path) -> list[Path]:
        """Record and map, beside the scenario or where the path says; none of a record at hand."""
        return [beside(folder, name) for name in (self.file, self.map) if name and beside(folder, name).is_file()]

    def check(self, duration: float, dt: float) -> None:
        """Check that the record is long enough, and that its rows fit the sampling interval.

        Raises
        ------
        ScenarioError
            Either is not so.
        """
        if self._each(dt) == 0:
            raise ScenarioError(
                f"sampling_s = {dt:g} does not fit {Path(self.file).name}, with a row every {self._step:g} s; give a "
                "whole part or a multiple of that, or import it with another grid: {step: ...}"
            )
        if duration > self.duration_s * (1 + 1e-9):
            raise ScenarioError(
                f"duration_s = {duration:g} is longer than {Path(self.file).name}, of which {self.duration_s:g} s can "
                "be played; make it shorter"
            )

    def values(self, time: FloatArray, seed: int) -> FloatArray:
        """Value held in the interval that starts at each time [s] (N,); over several rows their mean."""
        del seed
        each = self._each(float(time[1] - time[0]))
        if each < 2:
            return np.take(self._held, np.floor(time / self._step + 1e-6).astype(int))
        means: FloatArray = self._held[: each * len(time)].reshape(-1, each).mean(axis=1)
        return means

    def _each(self, dt: float) -> int:
        """Rows in each interval; minus the intervals in each row where these are longer; 0 where they do not fit."""
        rows, intervals = round(dt / self._step), round(self._step / dt)
        if rows >= 1 and abs(dt - rows * self._step) <= 1e-6 * dt:
            return rows
        return -intervals if intervals > 1 and abs(self._step - intervals * dt) <= 1e-6 * self._step else 0


def beside(folder: Path, name: str) -> Path:
    """Where a file lies that a scenario of a folder names: beside the scenario, else where the path says."""
    return folder / name if (folder / name).is_file() else Path(name)
