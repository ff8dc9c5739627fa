"""Level of an industrial zinc flotation cell under feedback: the model for a public record of a real loop.

Data: K. Dunn, OpenMV.net "flotation-cell": feed rate, upstream pH, copper sulphate, pulp level and air flow of one cell
every 30 s over a day. Units are not given, so level and flows count as scaled. The set point and the tailings valve of
the level loop are not recorded.
"""

from __future__ import annotations

import numpy as np

from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.columns import date_column, numeric_column
from adaptive_flot.greybox.data.dataset import Dataset, check_record
from adaptive_flot.greybox.data.tables import Source, named, read_table
from adaptive_flot.greybox.model import Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.quantities import KnownEffect
from adaptive_flot.processes.process import Measurements, Process

TIME = "Date and time"
COLUMNS = {
    "feed_flow": "Feed rate",
    "ph": "Upstream pH",
    "copper_sulphate": "CuSO4 added",
    "air_flow": "Air flow rate",
    "level": "Pulp level",
}
LONGEST_STEP = 1.5
"""A step longer than this many usual ones is a gap; no integration crosses it."""
_FEED = 330.0
"""Usual feed, about which the level is balanced."""

KNOWN_EFFECTS = (
    KnownEffect("level_sensor", "air_flow", "gas holdup that fools the level cell"),
    KnownEffect("level_sensor", "time", "level cell that drifts or jumps"),
    KnownEffect("level_sensor", "constant", "level cell with an offset or gain error"),
    KnownEffect("level_sensor", "lag", "slow level cell"),
    KnownEffect("feed_flow", "time", "feed meter that drifts"),
    KnownEffect("feed_flow", "lag", "pipe and box between meter and cell"),
    KnownEffect("feed_flow", "delay", "dead time between meter and cell"),
    KnownEffect("tails_valve", "level", "valve whose gain depends on where it stands"),
    KnownEffect("tails_valve", "time", "valve that wears or a loop that was tuned again"),
    KnownEffect("tails_valve", "lag", "slow valve"),
)


def make_model() -> Model:
    """Balance of the pulp with an unrecorded PI loop on the level.

    The feed counts as its deviation from the usual one::

        dh/dt = b (feed - 330) - v        level [scaled]
        dz/dt = (h - r) / T               integral of the controller
        v     = k ((h - r) + z)           outflow through the valve
    """
    guess = "first guess; to be fitted"
    return Model(
        name="zinc-level",
        states=(
            Quantity("level", "-", "pulp level, scaled", 0.0, 100.0, 5.0),
            Quantity("integral", "-", "integral action of the level controller", -200.0, 200.0, 5.0),
        ),
        inputs=(
            Quantity("feed_flow", "-", "feed rate, scaled", 0.0, 1e4, 30.0),
            Quantity("ph", "-", "pH upstream", 0.0, 14.0, 1.0, movable=False),
            Quantity("copper_sulphate", "-", "copper sulphate added, scaled", 0.0, 1e3, 2.0),
            Quantity("air_flow", "-", "air flow rate, scaled", 0.0, 1e3, 0.1),
        ),
        parameters=(
            Parameter("feed_gain", 1e-4, "1/s", guess, "b", -0.1, 0.1, 1e-3, role="estimated"),
            Parameter("loop_gain", 0.01, "1/s", guess, "k", 1e-4, 0.2, 0.01, role="estimated"),
            Parameter("reset_time", 300.0, "s", guess, "T", 10.0, 1e5, 300.0, role="estimated"),
            Parameter("setpoint", 29.0, "-", guess, "r", 0.0, 100.0, 5.0, role="estimated"),
        ),
        outputs=(Quantity("level", "-", "measured pulp level, scaled", scale=1.0),),
        equations=_equations,
        max_step_s=10.0,
        initial_guess={"level": 29.0, "integral": 0.0},
        starts_steady=False,
        known_effects=KNOWN_EFFECTS,
    )


def _equations(m: Scope) -> None:
    level, integral = m.state("level"), m.state("integral")
    feed = m.site("feed_flow", m.input("feed_flow"), "actuator")
    error = level - m.parameter("setpoint")
    away = m.site("tails_valve", m.parameter("loop_gain") * (error + integral), "actuator")
    m.derivative("level", m.parameter("feed_gain") * (feed - _FEED) - away)
    m.derivative("integral", error / m.parameter("reset_time"))
    m.output("level", m.site("level_sensor", level, "sensor", "offset"))


def read_record(path: Source) -> Dataset:
    """Read the published file: its longest stretch without a gap, on its mean sampling interval (30.5 s).

    Raises
    ------
    DataError
        A column is missing, a time can not be read, or an input is empty.
    RangeError
        An input outside its physical range.
    """
    file, table = named(path), read_table(path)
    missing = [c for c in (TIME, *COLUMNS.values()) if c not in table.columns]
    if missing:
        wanted = ", ".join((TIME, *COLUMNS.values()))
        raise DataError(f"{file}: column {missing[0]!r} is missing; the file of the zinc cell has {wanted}")
    when = date_column(table, TIME, file, "%d/%m/%Y %H:%M:%S")
    seconds = (when - when.iloc[0]).dt.total_seconds().to_numpy()
    steps = np.diff(seconds)
    if not (steps > 0).any():
        raise DataError(f"{file}: {TIME!r} does not increase; give a record of at least 2 times, the oldest first")
    breaks = np.flatnonzero((steps > LONGEST_STEP * np.median(steps)) | (steps < np.median(steps) / LONGEST_STEP)) + 1
    edges = np.concatenate([[0], breaks, [len(seconds)]])
    k = int(np.argmax(np.diff(edges)))
    rows = slice(int(edges[k]), int(edges[k + 1]))
    values = {name: numeric_column(table, column, file)[rows] for name, column in COLUMNS.items()}
    count = rows.stop - rows.start
    if count < 2:
        raise DataError(f"{file}: no two rows in a row without a gap; give a longer record")
    dt = float(np.mean(np.diff(seconds[rows])))
    model = make_model()
    inputs = np.column_stack([values[q.name] for q in model.inputs])
    record = Dataset(file.stem, dt * np.arange(count, dtype=float), dt, inputs, values["level"][:, None])
    return check_record(record, model, table.iloc[rows], file)


PROCESS = Process("zinc-level", make_model, lambda source: Measurements(read_record(source)))
