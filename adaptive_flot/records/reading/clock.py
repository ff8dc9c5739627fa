"""From clock times to instants: time zones, and the two hours of a year in which summer time begins and ends."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from adaptive_flot.errors import DataError
from adaptive_flot.records.reading.raw import UnclearError

Instants = np.ndarray[Any, np.dtype[np.int64]]
HOUR = 3600 * 10**9
CHANGES = (3, 4, 9, 10, 11)
"""Months in which clocks are changed somewhere."""


def to_utc(clock: Instants, zone: str, lines: Instants, file: Path) -> Instants:
    """Instants [ns since 1970, UTC] of the clock times (N,) of one logger, in the order of the file.

    The hour that is there twice as summer time ends is told apart by the order: what stands before the clock goes back
    is summer time.

    Raises
    ------
    DataError
        A time that the clock skipped, or one in the doubled hour of which nobody can say which it is.
    """
    naive = pd.DatetimeIndex(clock.astype("datetime64[ns]"))
    skipped = np.asarray(naive.tz_localize(zone, ambiguous=np.ones(len(naive), bool), nonexistent="NaT").isna())
    if skipped.any():
        k = int(np.flatnonzero(skipped)[0])
        raise DataError(
            f"{file}: line {lines[k]}: {naive[k]} does not exist in {zone}, where clocks went forward; "
            "correct the zone: a logger that keeps no summer time is in UTC, or a zone as Etc/GMT-1"
        )
    unclear = np.asarray(naive.tz_localize(zone, ambiguous="NaT").isna())
    summer = _summer(clock, unclear, zone, lines, file) if unclear.any() else np.ones(len(clock), bool)
    found = naive.tz_localize(zone, ambiguous=summer).tz_convert("UTC").tz_localize(None)
    return found.to_numpy().astype("datetime64[ns]").astype(np.int64)


def _summer(clock: Instants, unclear: Any, zone: str, lines: Instants, file: Path) -> Any:
    """Mask of the times of the doubled hour that are still summer time."""
    summer = np.ones(len(clock), bool)
    backwards = bool(np.median(np.diff(clock)) < 0) if len(clock) > 1 else False
    order = np.arange(len(clock))[:: -1 if backwards else 1]
    inside = np.flatnonzero(unclear[order])
    for block in np.split(inside, np.flatnonzero(np.diff(inside) > 1) + 1):
        rows = order[block]
        steps = np.diff(clock[rows])
        back = np.flatnonzero(steps < 0)
        usual = float(np.median(np.abs(np.diff(clock)))) if len(clock) > 1 else 0.0
        before = block[0] > 0 and 0 <= clock[rows[0]] - clock[order[block[0] - 1]] <= 3 * usual
        after = block[-1] + 1 < len(order) and 0 <= clock[order[block[-1] + 1]] - clock[rows[-1]] <= 3 * usual
        if len(back) == 1:
            summer[rows[back[0] + 1 :]] = False
        elif len(back) > 1 or before == after:
            line = int(lines[rows[0]])
            raise DataError(
                f"{file}: line {line}: this hour is there twice in {zone}, as summer time ends, and the order of the "
                "rows does not say which it is; export in UTC, or with an offset (+01:00)"
            )
        elif after:
            summer[rows] = False
    return summer


def check_clock(clock: Instants, lines: Instants, file: Path) -> None:
    """Refuse a clock that was set back or forward by an hour, where no zone says when.

    Raises
    ------
    UnclearError
        The clock goes back by an hour once, or a whole hour is missing, in a month of such changes.
    """
    if len(clock) < 3:
        return
    steps = np.diff(clock) * (-1 if np.median(np.diff(clock)) < 0 else 1)
    usual = float(np.median(steps))
    back = np.flatnonzero(steps < 0)
    hole = np.flatnonzero(np.abs(steps - usual - HOUR) <= 0.5 * usual) if usual < HOUR / 4 else np.array([], int)
    hour_back = len(back) == 1 and abs(steps[back[0]] + HOUR - usual) <= 3 * usual
    at = int(back[0]) if hour_back else None
    word = "back"
    if at is None and not len(back):
        night = [int(k) for k in hole if pd.Timestamp(int(clock[k])).hour <= 3]
        at, word = (night[0], "forward") if night else (None, "")
    if at is None or pd.Timestamp(int(clock[at])).month not in CHANGES:
        return
    raise UnclearError(
        f"{file}: line {lines[at + 1]}: the clock goes {word} by an hour, as where summer time begins or ends",
        "time",
        [{"zone": zone} for zone in ("Europe/London", "America/Santiago", "UTC")],
    )
