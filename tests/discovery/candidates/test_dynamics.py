"""Actuators that stick, reach a limit or do not close are found as such: on the heated tank, whose heater does so."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.discovery.candidates.dynamics import bounded, dragged
from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.record.slip_jump import jumped
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.scope import Site
from tests.discovery.heated import Truth, heated_tank, moves, tank_record


def _told(asked: np.ndarray, given_: np.ndarray) -> Dataset:
    """A record whose tank got other power than the record tells."""
    fan = moves(len(asked), 5, 20, 25, 3)
    done = tank_record(Truth(exponent=0.0), len(asked), 0, np.column_stack([given_, fan]))
    return replace(done, inputs=np.column_stack([asked, fan]))


@given(st.lists(st.floats(-5, 5), min_size=2, max_size=30), st.floats(0.1, 3.0))
def test_what_is_dragged_is_never_further_behind_than_its_band_and_moves_no_more_than_it_must(
    demand: list[float], band: float
) -> None:
    v = np.array(demand)
    position = dragged(v, band)
    assert np.all(np.abs(position - v) <= band + 1e-12)
    still = np.abs(v[1:] - position[:-1]) <= band
    np.testing.assert_array_equal(position[1:][still], position[:-1][still])


def test_a_heater_at_its_limit_is_named() -> None:
    asked = moves(600, 500, 3000, 30, 1)
    found = discover(heated_tank(), _told(asked, np.minimum(asked, 2000.0))).verdict
    assert found.word in ("named", "class")
    assert (found.effects[0].effect.site, found.effects[0].effect.driver) in (
        ("heating", "saturation"),
        ("heating", "power"),  # a curve of the power is the same statement
    )
    if found.effects[0].effect.driver == "saturation":
        assert found.effects[0].effect.coefficients["limit"] == pytest.approx(0.9 * 2000.0, rel=0.03)


def test_a_heater_that_does_not_close_is_named_with_what_it_lets_through() -> None:
    """Without a reference, too. It was told as a heater that depends on its own power, by a curve."""
    asked = moves(600, 500, 3000, 30, 1)
    found = discover(heated_tank(), _told(asked, np.maximum(asked, 1200.0))).verdict
    assert found.word == "named", found.reason
    (told,) = found.effects
    assert (told.effect.site, told.effect.driver, told.effect.form) == ("heating", "own_value", "leak")
    floor = told.effect.coefficients["level"]
    assert floor == pytest.approx(0.9 * 1200.0, rel=0.03)
    assert found.reason.startswith("Heating does not go below 1080 W, whatever is asked"), found.reason


@pytest.mark.parametrize(
    ("driver", "end", "expected"), [("own_value", 0.0, [0.1, 0.25, 0.4]), ("saturation", 1.0, [0.6, 0.75, 0.9])]
)
def test_a_part_that_rests_at_its_end_is_scored_at_shares_of_its_range(
    driver: str, end: float, expected: list[float]
) -> None:
    """A valve that is shut for most of the time: all quantiles of what is asked are zero, and no floor was tried."""
    asked = np.where(np.arange(1000) < 950, end, np.linspace(0.0, 1.0, 1000) if end else np.linspace(1.0, 0.0, 1000))
    asked[-1] = 1.0 - end
    responses: Any = SimpleNamespace(site_values={"valve": asked}, is_hidden=lambda site, change: False)
    bounds = [b for v in bounded(Site("valve", "actuator", "factor", 1), driver, responses) for _, b in v.start]
    assert bounds == pytest.approx(expected)


def test_a_heater_with_play_is_told_with_its_size() -> None:
    """A random walk of the demand, followed by a heater in a wide dead band."""
    rng = np.random.default_rng(2)
    asked = 1700.0 + np.repeat(np.clip(np.cumsum(rng.normal(0, 250, 150)), -1200, 1300), 4)
    found = discover(heated_tank(), _told(asked, dragged(asked, 400.0))).verdict
    assert found.word in ("named", "class")
    (told,) = found.effects
    assert (told.effect.site, told.effect.driver) == ("heating", "lag")
    values = told.effect.coefficients
    play = values.get("rest", values["band"])
    assert play == pytest.approx(0.9 * 400.0, rel=0.05)
    assert found.reason.startswith(f"Heating has play: it stays up to {play:.3g} W behind what is asked"), found.reason


def test_a_heater_that_sticks_and_then_jumps_is_told_with_all_bands_that_draw_its_jumps() -> None:
    rng = np.random.default_rng(3)
    asked = 1700.0 + np.repeat(np.clip(np.cumsum(rng.normal(0, 250, 150)), -1200, 1300), 4)
    found = discover(heated_tank(), _told(asked, jumped(asked, 400.0))).verdict
    assert found.word == "named"
    (told,) = found.effects
    assert (told.effect.site, told.effect.form) == ("heating", "slip_jump")
    assert "then jumps to what is asked" in found.reason
    least, largest = told.interval95["band"]
    assert least <= 0.9 * 400.0 <= largest and least <= told.effect.coefficients["band"] <= largest
    assert largest < 1.15 * least
