"""Protects: what is switched in every period is found with its times, whatever they are."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.discovery.innovations.events.cycling import best_cycle, is_on, possible_periods, refined_period
from adaptive_flot.discovery.verdict.words.curve import _places
from adaptive_flot.greybox.effects import Effect

DT, ROWS, DAY = 900.0, 1000, 86_400.0


@given(
    onset=st.floats(0.0, DAY - DT),
    share=st.floats(0.05, 0.45),
    size=st.sampled_from([-2.0, 0.7]),
    start=st.sampled_from([0.0, 1e6]),
)
def test_a_switch_of_every_day_is_found_to_within_a_row(onset: float, share: float, size: float, start: float) -> None:
    """With a constant beside it, as every site has one: its pause explains as much, and the shorter of both is told."""
    time = start + DT * (np.arange(ROWS, dtype=np.float64) + 0.5)
    course = size * is_on(time, DAY, onset, share * DAY)
    innovations = course - course.mean()
    found = best_cycle(lambda x: x - x.mean(axis=0), innovations, np.ones(ROWS), time, DT, DAY)
    assert found is not None
    assert found.size == pytest.approx(size, rel=0.03)
    assert abs(found.duration - share * DAY) <= DT
    away = np.mod(found.onset - onset + DAY / 2, DAY) - DAY / 2
    assert abs(away) <= DT and start - DT <= found.onset < start + DAY


def test_a_period_of_no_clock_is_found_near_that_of_a_wave() -> None:
    time, period = 10.0 * (np.arange(ROWS, dtype=np.float64) + 0.5), 700.0
    course = is_on(time, period, 100.0, 200.0)
    innovations = course - course.mean()
    wave = 10.0 * ROWS / 14  # the nearest that has whole periods in the record
    found = refined_period(lambda x: x - x.mean(axis=0), innovations, np.ones(ROWS), time, 10.0, wave)
    assert found == pytest.approx(period, rel=0.005)


def test_a_clock_is_asked_of_a_record_that_shows_it_often_enough() -> None:
    assert possible_periods(3 * DAY, 60.0) == [3600.0]
    assert possible_periods(5 * DAY, 900.0) == [DAY]  # an hour has four rows
    assert possible_periods(600.0, 1.0) == []


def test_the_form_is_on_in_every_period_as_the_search_has_it() -> None:
    told = {"amplitude": 2.0, "onset": 100.0, "duration": 200.0, "period": 700.0}
    effect = Effect("loss", "time", "cycle", told, {"width": 0.05})
    static, t = effect.family.static, ca.SX.sym("t")
    assert static is not None
    change = ca.Function("change", [t], [static(t, {k: ca.SX(v) for k, v in told.items()}, effect.full_settings)])
    time = np.arange(0.5, 5000.0, 1.0)
    found = np.array(change(time[None, :])).ravel()
    np.testing.assert_allclose(found, 2.0 * is_on(time, 700.0, 100.0, 200.0), atol=1e-3)


@pytest.mark.parametrize(("periods", "edges"), [(20, 40), (1000, 0)])
def test_its_picture_has_edges_where_it_is_switched(periods: int, edges: int) -> None:
    """Over three weeks its windows were drawn as peaks of several shapes. A thousand are too many to draw."""
    told = {"amplitude": 0.5, "onset": 100.0, "duration": 200.0, "period": 700.0}
    x = _places(Effect("loss", "time", "cycle", told, {"width": 0.5}), 0.0, periods * 700.0)
    times = [100.0 + 700.0 * k + w for k in range(periods) for w in (0.0, 200.0)]
    drawn = sum(bool(np.any(np.abs(x - t) < 0.6) and np.any(np.abs(x - t - 1.0) < 0.6)) for t in times)
    assert drawn >= edges and (edges or len(x) < 200)
