"""The data of charts: every value is in the block to its precision, thinned without losing what is seen."""

from __future__ import annotations

import json

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.charts.block import DIGITS, block, blocks, numbers
from adaptive_flot.charts.plotdata import Chart, Mark, Panel, Role, Strip, Trace
from adaptive_flot.charts.thinning import fair_share, kept_rows
from adaptive_flot.greybox.model import FloatArray

TIME = np.arange(1.0, 1001.0)


def decoded(content: dict[str, object]) -> FloatArray:
    """What `chart.js` makes of numbers."""
    first, step = float(str(content["o"])), float(str(content["s"]))
    if "n" in content:
        return first + step * np.arange(int(str(content["n"])), dtype=float)
    listed = content["v"]
    assert isinstance(listed, list)
    return np.array([np.nan if v is None else first + step * v for v in listed])


@given(st.lists(st.floats(-1e9, 1e9) | st.just(float("nan")), min_size=1, max_size=50))
def test_numbers_come_back_to_a_share_of_their_range(values: list[float]) -> None:
    given_values = np.array(values)
    back = decoded(json.loads(json.dumps(numbers(given_values))))
    assert np.array_equal(np.isnan(back), np.isnan(given_values))
    known = given_values[np.isfinite(given_values)]
    if known.size:
        tolerance = 10.0**-DIGITS * np.ptp(known) + 1e-9 * np.max(np.abs(known))
        assert np.allclose(back[np.isfinite(back)], known, rtol=0, atol=tolerance)


def test_times_come_back_to_a_millisecond() -> None:
    for time in (TIME, np.array([1.0, 2.0, 5.5, 7.25]), np.array([0.0, 0.0015]), 1e6 + np.array([0.0, 10.0, 40.0])):
        assert np.allclose(decoded(numbers(time, exact=True)), time, rtol=0, atol=1e-3)


@given(st.integers(50, 3000), st.integers(16, 400), st.integers(1, 4), st.integers(0, 2**31))
def test_thinned_lines_keep_their_extremes_their_ends_and_their_gaps(n: int, most: int, lines: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    drawn = [rng.standard_normal(n) for _ in range(lines)]
    drawn[0][n // 3 : n // 3 + 5] = np.nan
    rows = kept_rows(drawn, most)
    assert len(rows) <= max(most, 3 * lines + 2, 16) and rows[0] == 0 and rows[-1] == n - 1
    assert np.all(np.diff(rows) > 0)
    for line in drawn:
        assert (np.nanmin(line[rows]), np.nanmax(line[rows])) == (np.nanmin(line), np.nanmax(line))
    assert np.isnan(drawn[0][rows]).any()


def test_a_page_stays_within_its_budget_and_short_lines_stay_whole() -> None:
    long = Panel("a", "-", (Trace("x", np.arange(200_000.0), np.sin(np.arange(200_000.0)), Role.ESTIMATE),))
    short = Panel("b", "-", (Trace("x", TIME, TIME, Role.ESTIMATE),))
    first, second = (json.loads(text) for text in blocks([Chart((long,)), Chart((short,))], budget=20_000))
    assert 5_000 < len(first["panels"][0]["series"][0]["y"]["v"]) <= 9_000
    assert len(second["panels"][0]["series"][0]["y"]["v"]) == 1000
    assert fair_share([(200_000, 2), (1000, 2)], 20_000) == 9_000


def test_a_block_says_all_that_is_drawn() -> None:
    truth = Trace("truth", TIME, 1e-4 * TIME, Role.TRUTH)
    estimate = Trace("rpem", TIME[::2], 1e-4 * TIME[::2], Role.ESTIMATE, 2, std=np.full(500, 1e-4), held=True)
    strip = Strip("decided", TIME, ["mpc"] * 999 + ["hold_on"], "mpc")
    chart = Chart((Panel("C", "m^n/s", (truth, estimate), limits=(0.2,)),), (strip,), (Mark(500.0, "alarm"),))
    made = block(chart, 10_000)
    lines, strips = made["panels"]
    assert (lines["unit"], lines["limits"], len(lines["x"])) == ("mⁿ/s", [0.2], 2)
    assert [(s["label"], s["color"], s["x"], s["step"]) for s in lines["series"]] == [
        ("truth", "truth", 0, False),
        ("rpem", "slot-2", 1, True),
    ]
    assert "std" in lines["series"][1] and "std" not in lines["series"][0]
    assert strips["rows"][0]["spells"] == [["mpc", 0.0, 999.0, "usual"], ["hold on", 999.0, 1000.0, "state-0"]]
    assert made["marks"] == [{"x": 500.0, "label": "alarm"}] and made["x"]["range"] == [0.0, 1000.0]


def test_text_of_a_block_can_not_end_its_script() -> None:
    evil = Panel("</script><b>", "-", (Trace("<!--", TIME, TIME, Role.ESTIMATE),))
    (text,) = blocks([Chart((evil,))])
    assert "<" not in text and json.loads(text)["panels"][0]["label"] == "</script><b>"


def test_long_records_have_their_axis_in_hours_or_days() -> None:
    for end, unit in ((3600.0, "s"), (6 * 3600.0, "h"), (10 * 86400.0, "d")):
        trace = Trace("", np.array([0.0, end]), np.zeros(2), Role.TRUTH)
        assert block(Chart((Panel("a", "-", (trace,)),)), 100)["x"]["unit"] == unit
