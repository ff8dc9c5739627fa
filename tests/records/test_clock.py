"""Clock times become instants, also through the nights in which summer time begins and ends."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.errors import DataError
from adaptive_flot.records.reading.clock import check_clock, to_utc
from adaptive_flot.records.reading.raw import UnclearError
from adaptive_flot.records.reading.signals import read_export
from adaptive_flot.records.tag_map import TagMap

ZONES = ("Europe/London", "America/Santiago", "Australia/Adelaide", "UTC", "Asia/Kolkata")
NIGHTS = ("2025-10-26", "2026-04-05", "2025-11-02", "2026-03-29", "2025-09-07")
FILE = Path("export.csv")


def clock_of(instants: pd.DatetimeIndex, zone: str) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    naive = instants.tz_convert(zone).tz_localize(None)
    return naive.to_numpy().astype("datetime64[ns]").astype(np.int64)


@pytest.mark.parametrize("zone", ZONES)
@pytest.mark.parametrize("night", NIGHTS)
@pytest.mark.parametrize("newest_first", [False, True])
def test_a_whole_day_comes_back_through_any_zone(zone: str, night: str, newest_first: bool) -> None:
    instants = pd.date_range(night, periods=2 * 24 * 12, freq="5min", tz="UTC")[:: -1 if newest_first else 1]
    found = to_utc(clock_of(instants, zone), zone, np.arange(len(instants)), FILE)
    assert np.array_equal(found, clock_of(instants, "UTC"))


def test_half_of_the_doubled_hour_is_told_by_its_neighbours() -> None:
    before = pd.date_range("2025-10-25 23:40", "2025-10-26 00:40", freq="5min", tz="UTC")
    after = pd.date_range("2025-10-26 01:20", "2025-10-26 02:30", freq="5min", tz="UTC")
    for instants in (before, after):
        found = to_utc(clock_of(instants, "Europe/London"), "Europe/London", np.arange(len(instants)), FILE)
        assert np.array_equal(found, clock_of(instants, "UTC"))


def test_an_hour_of_which_nobody_knows_which_it_is_is_refused() -> None:
    alone = pd.date_range("2025-10-26 00:10", "2025-10-26 00:50", freq="5min", tz="UTC")
    with pytest.raises(DataError, match=r"export.csv: line 0: this hour is there twice in Europe/London"):
        to_utc(clock_of(alone, "Europe/London"), "Europe/London", np.arange(len(alone)), FILE)


def test_a_clock_that_was_changed_is_seen_where_no_zone_is_given() -> None:
    for start in ("2025-10-26 00:00", "2026-03-29 00:00"):
        instants = pd.date_range(start, periods=400, freq="1min", tz="UTC")
        with pytest.raises(UnclearError, match=r"the clock goes (back|forward) by an hour"):
            check_clock(clock_of(instants, "Europe/London"), np.arange(len(instants)), FILE)


def test_other_jumps_are_none_of_summer_time() -> None:
    whole = pd.date_range("2025-10-26 06:00", periods=400, freq="1min", tz="UTC")
    hole = whole[(np.arange(400) < 100) | (np.arange(400) > 145)]
    repeated = whole[np.concatenate([np.arange(400), np.arange(300, 320)])]
    for instants in (whole, hole, repeated):
        check_clock(clock_of(instants, "UTC"), np.arange(len(instants)), FILE)


def test_tags_of_an_hour_one_after_the_other_are_no_change_of_the_clock(tmp_path: Path) -> None:
    """In long form the time goes back by an hour where the next tag begins."""
    stamps = pd.date_range("2026-03-29 00:00:00", periods=360, freq="10s").strftime("%Y-%m-%d %H:%M:%S")
    rows = [f"{tag},{stamp},1.5,Good" for tag in ("A", "B") for stamp in stamps]
    (tmp_path / "export.csv").write_text("\n".join(["Tag,Timestamp,Value,Quality", *rows]))
    found = read_export(tmp_path / "export.csv", TagMap())
    assert {len(s) for s in found.signals.values()} == {360}
