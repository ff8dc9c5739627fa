"""An export of a plant: its signals, and what was found out about the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from adaptive_flot.greybox.quantities import FloatArray
from adaptive_flot.records.tag_map import FileKeys, TimeKeys

Instants = np.ndarray[Any, np.dtype[np.int64]]


@dataclass(frozen=True)
class Signal:
    """The values of one tag, in the order of time, at most one a time.

    Attributes
    ----------
    tag
        Its name in the file.
    unit, description
        As the file gives them; "" where it does not.
    time
        Times (n,) [ns since 1970, UTC].
    values
        Values (n,), NaN where none was read.
    lines
        Lines (n,) of the file.
    codes
        How often each text stands where a number should.
    examples
        Line of the first of each of these texts.
    poor
        Values whose quality is not good; they are NaN.
    repeated
        Values that were left out, since a later row of the file gives another for the same time.
    """

    tag: str
    unit: str
    description: str
    time: Instants
    values: FloatArray
    lines: Instants
    codes: Mapping[str, int] = field(default_factory=dict)
    examples: Mapping[str, int] = field(default_factory=dict)
    poor: int = 0
    repeated: int = 0

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True)
class Export:
    """What an export holds.

    Attributes
    ----------
    file
        Where it comes from.
    signals
        By tag, in the order of the file.
    file_keys, time_keys
        How it was read, as a map says it: nothing needs to be found out again.
    found
        What was found out, in words.
    """

    file: Path
    signals: Mapping[str, Signal]
    file_keys: FileKeys
    time_keys: TimeKeys
    found: tuple[str, ...]
