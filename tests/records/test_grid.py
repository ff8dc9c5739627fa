"""Values at their own times become rows: inputs as they acted, outputs as they were measured, gaps as gaps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from adaptive_flot.errors import DataError
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.quantities import Quantity
from adaptive_flot.records.clean import Cleaned
from adaptive_flot.records.grid import STATUSES, Rows, make_rows
from adaptive_flot.records.tag_map import TagKeys

FILE = Path("export.csv")


def signal(time: list[float], values: list[float], **keys: str) -> Cleaned:
    """Values at times [s]; NaN is a bad one."""
    found = np.array(values)
    fates = np.where(np.isfinite(found), 0, 1).astype(np.int8)
    t = (np.array(time) * 1e9).astype(np.int64)
    return Cleaned(Quantity("q", "-", ""), TagKeys.model_validate({"tag": "q", **keys}), "-", t, found, fates, found)


def named(cleaned: Cleaned, name: str) -> Cleaned:
    return Cleaned(Quantity(name, "-", ""), cleaned.keys, "-", cleaned.time, cleaned.values, cleaned.fates, cleaned.raw)


def rows(u: Cleaned, *outputs: Cleaned, step: float = 10.0, hold: float = 30.0, gaps: str = "split") -> Rows:
    return make_rows([named(u, "u")], [named(y, f"y{k}") for k, y in enumerate(outputs)], step, hold, gaps, FILE)


def words(found: Rows, name: str) -> list[str]:
    return [STATUSES[k] for k in found.statuses[name]]


def test_an_input_acts_from_its_stamp_until_the_next() -> None:
    """Row k has what acted since row k-1: the value stamped there."""
    found = rows(signal([0, 10, 20, 30], [1.0, 2.0, 3.0, 4.0]))
    assert (found.time / 1e9).tolist() == [10.0, 20.0, 30.0]
    assert found.values["u"].tolist() == [1.0, 2.0, 3.0] and words(found, "u") == ["measured"] * 3


def test_what_changes_inside_an_interval_is_weighted_by_time_so_that_the_integral_stays() -> None:
    found = rows(signal([0, 4, 20, 30], [1.0, 2.0, 3.0, 3.0]))
    assert found.values["u"] == pytest.approx([0.4 * 1 + 0.6 * 2, 2.0, 3.0])
    assert words(found, "u") == ["averaged", "measured", "measured"]
    sampled = rows(signal([0, 4, 20, 30], [1.0, 2.0, 3.0, 3.0], average="sample"))
    assert sampled.values["u"].tolist() == [1.0, 2.0, 3.0]


def integral(values: FloatArray, step: float) -> float:
    return float(values.sum() * step)


def test_any_stamps_keep_the_integral_of_the_held_input() -> None:
    rng = np.random.default_rng(7)
    time = np.concatenate([[0.0], np.sort(rng.uniform(0, 200, 60)).round(3), [200.0]])
    values = rng.normal(size=62)
    found = rows(signal(time.tolist(), values.tolist()), hold=100.0)
    assert integral(found.values["u"], 10.0) == pytest.approx(float(np.sum(values[:-1] * np.diff(time))), rel=1e-9)


def test_a_bad_value_is_bridged_by_the_one_before_as_long_as_it_may_be_held() -> None:
    found = rows(signal([0, 10, 20, 30, 40], [1.0, np.nan, np.nan, 4.0, 5.0]))
    assert found.values["u"].tolist() == [1.0, 1.0, 1.0, 4.0] and words(found, "u")[1:3] == ["held", "held"]


def test_a_hole_longer_than_that_splits_the_record_and_nothing_is_invented() -> None:
    u = signal([0, 10, 20, 100, 110, 120], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    found = rows(u)
    assert (found.time / 1e9).tolist() == [10, 20, 30, 40, 50, 110, 120]
    assert found.stretch.tolist() == [1] * 5 + [2] * 2
    assert rows(u, gaps="longest").stretch.tolist() == [1] * 5
    with pytest.raises(DataError, match=r"export.csv: a gap: from 1970-01-01 00:00:50 on"):
        rows(u, gaps="refuse")


def test_a_setpoint_that_is_logged_as_it_changes_may_be_held_for_longer() -> None:
    found = rows(signal([0, 90, 100], [1.0, 2.0, 2.0], hold_at_most="5 min"))
    assert len(found.time) == 10 and found.values["u"].tolist() == [1.0] * 9 + [2.0]
    assert words(found, "u") == ["measured", *["held"] * 8, "measured"]


def test_an_output_is_the_nearest_value_within_half_a_step_and_is_never_held() -> None:
    u = signal([0, 10, 20, 30, 40, 50], [1.0] * 6)
    y = signal([10.4, 19.0, 33, 35.1], [1.0, 2.0, 3.0, 4.0])
    found = rows(u, y)
    assert found.values["y0"][[0, 1, 2, 3]].tolist() == [1.0, 2.0, 3.0, 4.0] and np.isnan(found.values["y0"][4])
    assert words(found, "y0") == ["measured"] * 4 + ["missing"]


def test_an_output_may_be_the_mean_of_each_interval() -> None:
    u = signal([0, 10, 20, 30], [1.0] * 4)
    y = signal([1, 5, 10, 15, 21, 25], [1.0, 2.0, 3.0, 4.0, np.nan, np.nan], average="interval")
    found = rows(u, y)
    assert found.values["y0"][:2].tolist() == [2.0, 4.0] and np.isnan(found.values["y0"][2])
    assert words(found, "y0") == ["averaged", "measured", "bad"]


def test_a_bad_output_is_told_from_a_missing_one() -> None:
    u = signal([0, 10, 20, 30], [1.0] * 4)
    found = rows(u, signal([10, 20], [np.nan, 2.0]))
    assert words(found, "y0") == ["bad", "measured", "missing"]


def test_stamps_of_a_slow_clock_on_its_own_grid_lose_nothing() -> None:
    """A logger of 3.04 s whose stamps are whole seconds: every row has its value, none is there twice."""
    true = 3.04 * np.arange(400)
    stamps = np.round(true)
    y = signal(stamps.tolist(), list(map(float, range(400))))
    found = rows(signal(stamps.tolist(), [1.0] * 400), y, step=3.04, hold=10.0)
    assert found.values["y0"].tolist() == list(map(float, range(1, 400)))


def test_the_same_stamps_on_a_grid_of_three_seconds_miss_a_row_now_and_then_and_repeat_none() -> None:
    true = 3.04 * np.arange(400)
    found = rows(
        signal(true.tolist(), [1.0] * 400), signal(true.tolist(), list(map(float, range(400)))), step=3.0, hold=10.0
    )
    seen = found.values["y0"][np.isfinite(found.values["y0"])]
    assert np.all(np.diff(seen) >= 1) and len(seen) == len(set(seen.tolist()))
    assert words(found, "y0").count("missing") == len(found.time) - len(seen) <= 6


def test_a_step_longer_than_the_hold_is_refused() -> None:
    with pytest.raises(DataError, match=r"hold_at_most .5 s. is shorter than the step"):
        rows(signal([0, 10], [1.0, 1.0]), hold=5.0)
