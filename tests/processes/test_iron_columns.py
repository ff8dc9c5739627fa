"""The column model against its mass balance, and the reader of its record."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.errors import DataError
from adaptive_flot.greybox import Dataset, Stepper, steady_state
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.processes.iron_columns import HOUR, fresh, make_model, read_record
from benchmarks.real_records.mining_plant import corrected, last_seen, regression

USUAL = {
    "silica_feed": 0.15, "iron_feed": 0.56, "starch_flow": 2900.0, "amine_flow": 490.0, "pulp_flow": 400.0, "ph": 9.8,
    "pulp_density": 1.68, "air_1": 290.0, "air_2": 300.0, "level_1": 0.5, "level_2": 0.42,
}  # fmt: skip


def concentrate(parameters: dict[str, float], **changes: float) -> FloatArray:
    """Steady concentrate (silica, iron)."""
    model = make_model().with_parameters(parameters)
    u = np.array([(USUAL | changes)[q.name] for q in model.inputs])
    found: FloatArray = steady_state(model, u).state
    return found


def test_without_flotation_the_concentrate_is_the_feed() -> None:
    found = concentrate({"silica_rate": 0.01, "iron_rate": 0.0, "feed_trust": 1.0})
    np.testing.assert_allclose(found, [0.15, 0.56], rtol=0.01)


def test_with_perfect_flotation_only_iron_oxide_is_left() -> None:
    """70 % of hematite is iron: 2 x 55.845 / 159.69."""
    found = concentrate({"silica_rate": 100.0, "iron_rate": 0.0, "other_rate": 5.0, "half_coverage": 0.001})
    np.testing.assert_allclose(found, [0.0, 0.699], atol=0.005)


@given(st.floats(0.5, 8.0), st.floats(0.1, 3.0), st.floats(1.05, 1.6))
def test_more_collector_or_air_takes_silica_and_more_pulp_leaves_it(rate: float, half: float, more: float) -> None:
    parameters = {"silica_rate": rate, "half_coverage": half}
    usual = concentrate(parameters)[0]
    assert concentrate(parameters, amine_flow=490.0 * more)[0] < usual
    assert concentrate(parameters, air_1=290.0 * more)[0] < usual
    assert concentrate(parameters, pulp_flow=400.0 * more)[0] > usual
    assert concentrate({**parameters, "feed_trust": 0.0}, silica_feed=0.3, amine_flow=490.0)[0] == pytest.approx(usual)


def test_a_step_arrives_with_the_lag() -> None:
    model = make_model().with_parameters({"lag": 2 * HOUR})
    u = np.array([USUAL[q.name] for q in model.inputs])
    start = steady_state(model, u).state
    u[model.index("inputs", "air_1")] = 250.0
    end = steady_state(model, u).state
    run = Stepper(model, HOUR).simulate(start, np.tile(u, (4, 1)))
    share = (run.states[:, 0] - start[0]) / (end[0] - start[0])
    np.testing.assert_allclose(share, 1 - np.exp(-np.arange(1, 5) / 2), rtol=1e-4)


def test_held_assays_are_missing_after_their_first() -> None:
    assay = np.array([1.0, 1.1, 1.1, *[2.0] * 6, 1.5, 1.4])
    expected = assay.copy()
    expected[4:9] = np.nan
    np.testing.assert_array_equal(fresh(assay), expected)


def _table(hours: int = 300) -> pd.DataFrame:
    when = pd.date_range("2017-04-11 05:00", periods=hours, freq="h").strftime("%Y-%m-%dT%H:%M")
    rng = np.random.default_rng(0)
    columns = {"silica_feed_pct": 15.0, "iron_feed_pct": 56.0, "starch_flow": 2900.0, "amine_flow": 490.0,
               "pulp_flow": 400.0, "pulp_ph": 9.8, "pulp_density": 1.68}  # fmt: skip
    columns |= {f"air_{k:02d}": 280.0 + k for k in range(1, 8)} | {f"level_{k:02d}": 400.0 + k for k in range(1, 8)}
    table = pd.DataFrame({"hour": when} | columns)
    return table.assign(silica_conc_pct=2 + rng.random(hours), iron_conc_pct=65 + rng.random(hours))


def test_the_record_is_read_in_the_models_units(tmp_path: Path) -> None:
    table = _table()
    table.to_csv(tmp_path / "hourly.csv", index=False)
    record = read_record(tmp_path / "hourly.csv")
    model = make_model()
    model.check_inputs(record.inputs)
    assert len(record) == 295 and record.dt == HOUR  # the hours before the data hold ends are left out
    usual = dict(zip(model.names("inputs"), record.inputs[0], strict=True))
    assert usual["air_1"] == 282.0 and usual["air_2"] == 285.5 and usual["level_2"] == pytest.approx(0.4055)
    np.testing.assert_allclose(record.outputs[:, 0], table["silica_conc_pct"][5:] / 100)


@pytest.mark.parametrize(
    ("table", "says"),
    [
        (_table().drop(columns="air_03"), "air_03"),
        (_table().drop(index=100), "one row an hour"),
        (_table().drop(columns="hour"), "hour"),
    ],
)
def test_another_table_is_refused_in_one_line(tmp_path: Path, table: pd.DataFrame, says: str) -> None:
    table.to_csv(tmp_path / "hourly.csv", index=False)
    with pytest.raises(DataError, match=says):
        read_record(tmp_path / "hourly.csv")


def test_an_hour_ahead_looks_at_nothing_later() -> None:
    """The benchmark's predictions of an hour do not change with what is measured in it or after it."""
    rng = np.random.default_rng(1)
    y, inputs = np.cumsum(rng.standard_normal((200, 2)), axis=0), rng.standard_normal((200, 3))
    y[::17] = np.nan
    later = y.copy()
    later[150:] += 10.0
    model = 0.5 * y + rng.standard_normal((200, 2))
    model[::17] = 0.0

    def ahead(series: FloatArray) -> list[FloatArray]:
        record = Dataset("r", HOUR * np.arange(200.0), HOUR, inputs, series)
        seen = last_seen(series)
        return [seen, corrected(model, series, 140), regression(record, 140, seen)]

    for a, b in zip(ahead(y), ahead(later), strict=True):
        np.testing.assert_array_equal(a[:151], b[:151])
        assert not np.array_equal(a[151:], b[151:])
