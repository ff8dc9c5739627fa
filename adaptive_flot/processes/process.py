"""What the registry knows of a shipped process: its name, its model, and how its published measurements are read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.data.tables import Source
from adaptive_flot.greybox.model import Model


@dataclass(frozen=True)
class Measurements:
    """Measured records of a process.

    Attributes
    ----------
    record
        The record to work on.
    validation
        A second record of the same process, where the published file holds one; nothing is fitted to it.
    """

    record: Dataset
    validation: Dataset | None = None


@dataclass(frozen=True)
class Process:
    """A shipped process that needs no cell file.

    Attributes
    ----------
    name
        Name of the process and of its model.
    make_model
        Makes the model.
    read_published
        Reads the published file of its measurements, whose columns are not those of the model.
    """

    name: str
    make_model: Callable[[], Model]
    read_published: Callable[[Source], Measurements]
