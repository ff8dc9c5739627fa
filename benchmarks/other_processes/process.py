"""What a process of this benchmark has: the user's model, the plant, and what may be the matter with it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from adaptive_flot.greybox import Model, Parameter
from benchmarks.other_processes.world import Columns, World

Pair = tuple[str, str]
NOTHING = "nothing"
SHIFT, EVENT, ENDS, MOVES = "constant", "time", ("own_value", "saturation"), "lag"


@dataclass(frozen=True)
class Case:
    """One thing that may be the matter.

    Attributes
    ----------
    names
        Right names (site, driver): the true one first, then those of the same physics. Empty where nothing is.
    when
        `alone` for what a plant has from the start: it does not come between two records. `reference` for what one
        record alone can not show, since constants take it up. `both` else.
    model
        Function of the process's module that makes the model.
    tolerated
        Further true names, which tell of a disturbance and not of an effect.
    """

    names: tuple[Pair, ...]
    when: Literal["both", "alone", "reference"] = "both"
    model: str = "make_model"
    tolerated: tuple[Pair, ...] = ()


@dataclass(frozen=True)
class Process:
    """A process.

    Attributes
    ----------
    name
        Its name, that of its module in `plants`.
    dt, rows
        Seconds between rows, and fewest and most rows.
    make_model
        The user's model.
    plant
        Makes the columns of a record, without what sensors do to it.
    noise
        Standard deviation of the noise of each output, by column.
    cases
        What may be the matter, by name.
    tolerated
        True names of what the plant has on every record and the model has not, with why. What wanders a little is
        none: a name for it would be a false alarm.
    controlled
        Whether a controller may move an input.
    """

    name: str
    dt: float
    rows: tuple[int, int]
    make_model: Callable[[], Model]
    plant: Callable[[World], Columns]
    noise: Mapping[str, float]
    cases: Mapping[str, Case]
    tolerated: Mapping[Pair, str] = field(default_factory=dict)
    controlled: bool = False


def estimated(name: str, value: float, unit: str, factor: float = 20.0) -> Parameter:
    """A constant that is fitted, within a factor of its value."""
    lower, upper = value / factor, value * factor
    return Parameter(name, value, unit, "a guess", lower=lower, upper=upper, scale=value / 3, role="estimated")
