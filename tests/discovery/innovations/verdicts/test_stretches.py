"""Errors on held-out stretches: what wanders before a stretch is not in them, and no row of one fits anything."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.families import FOREVER, Hypothesis
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.verdicts.stretches import errors_over_folds, errors_over_stretches, is_on
from adaptive_flot.discovery.since_reference.changes import find_changes
from adaptive_flot.greybox import Dataset, Effect
from tests.discovery.innovations.late_tank import DT, TIME, model

NOISE, DEAD = 0.01, 0.3


def tank(seed: int, rows: int, wander: float, dead: float = 0.0) -> Dataset:
    """The tank of `late_tank`, its gauge in time, its pump at rest within `dead` of zero; Euler, twenty steps a row."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-1.0, 1.0, rows // 20), 20)
    given = np.sign(u) * np.maximum(np.abs(u) - dead, 0.0)
    x, y = 0.0, []
    for k in range(rows):
        for _ in range(20):
            x += DT / 20 * (given[k] - x) / TIME + wander * np.sqrt(DT / 20) * rng.standard_normal()
        y.append(x + NOISE * rng.standard_normal())
    return Dataset("tank", DT * np.arange(1.0, rows + 1), DT, u[:, None], np.array(y)[:, None])


def searched(record: Dataset) -> tuple[Search, Explanation]:
    search = Search(model(), record, (0,), np.array([NOISE]), ("time",))
    return search, search.base(search.model.parameter_values)


def test_a_model_that_is_right_leaves_the_noise_on_every_stretch() -> None:
    search, base = searched(tank(1, 600, 0.0))
    (whole,) = errors_over_folds(search, base, base)
    assert whole.after == pytest.approx(NOISE, rel=0.1)
    assert whole.before == whole.after, "the same explanation twice"


def test_what_has_wandered_before_a_stretch_is_not_in_its_error() -> None:
    """Noise of 0.02 a root second: a free run is off by 0.02 sqrt(T / 2) = 0.09, five rows after a measurement less."""
    record = tank(2, 600, 0.02)
    search, base = searched(record)
    held_out = np.zeros(600, dtype=bool)
    for first in range(100, 600, 50):
        held_out[first : first + 5] = True
    (near,) = errors_over_stretches(search, base, base, held_out)
    free = 0.0 - record.outputs[:, 0]
    for k in range(600):  # x' = (u - x) / T from rest, by its solution over one row
        free[k:] += record.inputs[k, 0] * np.exp(-np.arange(600 - k) * DT / TIME) * -np.expm1(-DT / TIME)
    assert np.sqrt(np.mean(free**2)) == pytest.approx(0.02 * np.sqrt(TIME / 2), rel=0.4)
    assert near.after == pytest.approx(0.02 * np.sqrt(3.0), rel=0.4), "the mean over one to five rows"


def test_no_row_of_a_stretch_fits_the_constants() -> None:
    """Rows that are absurd make the error of their own stretch large, and leave the prediction there as it was."""
    record = tank(3, 600, 0.005)
    search, base = searched(record)
    held_out = np.zeros(600, dtype=bool)
    held_out[300:360] = True
    absurd = replace(record, outputs=record.outputs + np.where(held_out, 7.0, 0.0)[:, None])
    again = replace(search, record=absurd)
    (right,), (wrong,) = (errors_over_stretches(s, base, base, held_out) for s in (search, again))
    assert wrong.after == pytest.approx(7.0, abs=3 * right.after + 0.1)


def test_a_pump_that_rests_near_zero_is_told_beside_what_wanders() -> None:
    """A dead zone is no hypothesis of the comparison with a reference: its gains explain it about as well."""
    compared = find_changes(model(), [tank(4, 500, 0.004, DEAD)], [tank(5, 400, 0.004)], adapted=("time",))
    assert compared.verdict.word == "named"
    (effect,) = compared.verdict.effects
    assert (effect.effect.site, effect.effect.driver) == ("pump", "own_value")
    assert (
        "does not move within 0.3" in compared.verdict.reason or "does not move within 0.2" in compared.verdict.reason
    )
    (error,) = compared.verdict.error
    assert error.after < 0.5 * error.before


def test_rows_in_which_an_event_is_on_are_those_between_its_times() -> None:
    """Two pulses, the second for good; what lasts is no event."""
    told = {"on_1": 20.0, "for_1": 15.0, "on_2": 70.0, "for_2": FOREVER}
    effect = Effect("pump", "time", "switch", told, {"count": 2.0, "width": 0.1}, mode="offset")
    event = Hypothesis("pump", "time", "switch", effect, ("amplitude",), ({},))
    lasting = Hypothesis("gauge", "constant", "offset", Effect("gauge", "constant", "shift"), ("amplitude",), ({},))
    explanation: Any = SimpleNamespace(hypotheses=(lasting, event))
    time = np.arange(0.0, 100.0, 10.0)
    np.testing.assert_array_equal(time[is_on(explanation, time)], [20.0, 30.0, 70.0, 80.0, 90.0])
    assert not is_on(SimpleNamespace(hypotheses=(lasting,)), time).any()  # type: ignore[arg-type]
