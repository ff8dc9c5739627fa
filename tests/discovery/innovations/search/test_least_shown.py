"""Protects: what a record that shows nothing is said to have shown, it would have shown.

The size is checked against the gain of changes that were really made, and by cases where the answer is known.
"""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.hypotheses.joint.known_before import Constants
from adaptive_flot.discovery.innovations.filter.refit import Refitter
from adaptive_flot.discovery.innovations.search.explanation import LEAST_GAIN
from adaptive_flot.discovery.innovations.search.least_shown import least_shown
from adaptive_flot.discovery.results.least_shown import LeastShown, what_is_hidden, what_is_shown
from adaptive_flot.discovery.since_reference.changes import find_changes
from adaptive_flot.greybox import Dataset
from adaptive_flot.report.discovery.tables import least_shown_table
from tests.discovery.innovations.box import model, record

FLOOR = np.array([0.04])
CONSTANTS = ("conductance", "exchange", "capacity", "wall_capacity")


def _fitter(data: Dataset, free: tuple[str, ...] = CONSTANTS, known: Constants | None = None) -> Refitter:
    return Refitter(model(), data, (0,), FLOOR, free, known)


def _sizes(data: Dataset, free: tuple[str, ...] = CONSTANTS, known: Constants | None = None) -> dict[str, float]:
    fitter = _fitter(data, free, known)
    return {s.site: s.size for s in least_shown(fitter, fitter.at(model().parameter_values))}


def test_a_change_of_that_size_gains_enough_in_about_four_of_five_records() -> None:
    """The thermometer shows so much more from halfway on; the gain is that of a regression on the innovations."""
    shown = []
    for seed in range(20):
        data = record((), seed=seed)
        fitter = _fitter(data)
        fit = fitter.fit(model().parameter_values)
        size = {s.site: s.size for s in least_shown(fitter, fit)}["thermometer"]
        later = np.arange(len(data)) >= (len(data) + 1) // 2
        moved = Dataset("moved", data.time, data.dt, data.inputs, data.outputs + size * later[:, None])
        again = _fitter(moved)
        response = again.response(again.fit(fit.p, fit.size, hold_noise=True), ["thermometer"])
        course = later[1:].astype(float)[:, None]
        columns = np.hstack([response.by_constants, response.respond("thermometer", course)])
        e = response.innovations
        rest = [float(np.sum((e - c @ np.linalg.lstsq(c, e, rcond=None)[0]) ** 2)) for c in (columns[:, :-1], columns)]
        shown.append((rest[0] - rest[1]) / 2 > LEAST_GAIN + np.log(len(data)))
    assert 0.55 <= np.mean(shown) <= 0.99, np.mean(shown)  # 20 records of a share of 0.8: 99.9 %


def test_what_is_known_of_constants_lets_smaller_changes_show() -> None:
    """Held constants are known without a doubt; a constant that is free takes up a part of a change."""
    data = record((), seed=1)
    free, held = _sizes(data), _sizes(data, ())
    assert all(held[site] <= free[site] * (1 + 1e-6) for site in free)
    assert held["loss"] < 0.9 * free["loss"]


def test_a_factor_is_told_as_a_share_and_an_amount_in_its_unit() -> None:
    data = record((), seed=2)
    fitter = _fitter(data)
    found = {s.site: s for s in least_shown(fitter, fitter.at(model().parameter_values))}
    assert found["loss"].by_factor and 0 < found["loss"].size < 1
    assert not found["other_heat"].by_factor and found["other_heat"].unit == "W"


def test_a_heater_that_is_off_shows_nothing_of_itself() -> None:
    """No power: whatever share of it is lost, the record is the same."""
    data = record((), seed=2)
    noise = np.random.default_rng(0).normal(scale=0.04, size=data.outputs.shape)
    fitter = _fitter(Dataset("off", data.time, data.dt, np.zeros_like(data.inputs), 22.0 + noise))
    found = {s.site: s for s in least_shown(fitter, fitter.at(model().parameter_values))}
    assert found["heater"].hidden
    assert "heater" in what_is_hidden(tuple(found.values()))


@pytest.mark.parametrize(
    ("found", "shown", "hidden"),
    [
        ((), "", ""),
        ((LeastShown("hot_valve", True, 0.031, "-"),), "hot valve 3.1 %", ""),
        ((LeastShown("fan", True, 0.8, "-"),), "", "fan"),
        ((LeastShown("meter", False, float("inf"), "m"),), "", "meter"),
        ((LeastShown("meter", False, 0.2, "m"), LeastShown("fan", True, 0.51, "")), "meter 0.2 m.", "fan"),
    ],
)
def test_words(found: tuple[LeastShown, ...], shown: str, hidden: str) -> None:
    said = "".join(what_is_shown(found))
    assert shown in said and bool(said) == bool(shown)
    assert hidden in what_is_hidden(found) and bool(what_is_hidden(found)) == bool(hidden)
    assert not any("meter inf" in s or "fan 8" in s for s in (said, what_is_hidden(found)))


def test_the_page_has_them_in_a_table() -> None:
    found = (
        LeastShown("hot_valve", True, 0.031, "-"),
        LeastShown("fan", True, 0.8, "-"),
        LeastShown("meter", False, 0.2, "m"),
    )
    table = least_shown_table(SimpleNamespace(verdict=SimpleNamespace(least_shown=found)))  # type: ignore[arg-type]
    assert table is not None
    assert table.rows == (
        ("hot valve", "falls by", "3.1 %"), ("fan", "falls by", "not by half"), ("meter", "moves by", "0.2 m"),
    )  # fmt: skip
    nothing = SimpleNamespace(verdict=SimpleNamespace(least_shown=()))
    assert least_shown_table(nothing) is None  # type: ignore[arg-type]


def test_none_says_so_with_and_without_a_reference() -> None:
    """A record of the model itself: the sizes are among the notes, and in the machine-readable verdict."""
    steady = model()
    data = [record((), rows=200, seed=s) for s in (11, 12)]
    for verdict in (discover(steady, data[0]).verdict, find_changes(steady, [data[0]], [data[1]]).verdict):
        assert verdict.word == "none", verdict.reason
        assert [s.site for s in verdict.least_shown] == [s.name for s in steady.sites]
        assert any(note.startswith("A change that lasts from halfway on") for note in verdict.notes)
        assert len(json.loads(json.dumps(verdict.as_dict()))["least_shown"]) == len(steady.sites)
