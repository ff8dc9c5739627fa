"""The data screening: every kind of bad record is told by its reason, and none of them is ever given a name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.record.screening import OUTLIER_SHARE, _outliers, screen
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Scope
from tests.discovery.heated import Truth, changed, heated_tank, tank_record

Change = Callable[[FloatArray], FloatArray]


def _record(change: Change | None = None, rows: int = 600) -> Dataset:
    record = tank_record(Truth(exponent=0.0), rows)
    return changed(record, change(record.outputs[:, 0].copy())) if change else record


def _frozen(y: FloatArray) -> FloatArray:
    y[200:300] = y[200]
    return y


def _clipped(y: FloatArray) -> FloatArray:
    return np.minimum(y, np.quantile(y, 0.8))


def _gap(y: FloatArray) -> FloatArray:
    y[250:330] = np.nan
    return y


def _storm(y: FloatArray) -> FloatArray:
    rng = np.random.default_rng(0)
    return np.where(rng.random(len(y)) < 0.4, y + 30 * rng.standard_normal(len(y)), y)


def _dead(y: FloatArray) -> FloatArray:
    return np.full(len(y), 300.0)


def _nothing(y: FloatArray) -> FloatArray:
    return np.full(len(y), np.nan)


@given(st.floats(6.0, 40.0), st.floats(0.0, 4.0))
def test_what_swings_fast_is_no_storm(rows: float, sharp: float) -> None:
    """The acceleration of a hardening spring has narrow peaks: a healthy accelerometer was left out for them."""
    angle = 2 * np.pi * np.arange(900) / rows
    swing = np.sinh((1 + sharp) * np.sin(angle)) + 0.02 * np.random.default_rng(0).normal(size=900)
    assert _outliers(swing) <= OUTLIER_SHARE


@given(st.integers(0, 200), st.integers(250, 900))
def test_a_good_record_passes_untouched(seed: int, rows: int) -> None:
    record = tank_record(rows=rows, seed=seed)
    checked = screen(record, heated_tank())
    assert checked.reasons == () == checked.notes
    np.testing.assert_array_equal(checked.record.outputs, record.outputs)


@pytest.mark.parametrize(
    ("change", "rows", "says"),
    [(None, 150, "150 usable samples"), (_dead, 600, "constant"), (_nothing, 600, "no output"), (_storm, 600, "storm")],
)
def test_a_record_that_says_nothing_is_insufficient_with_its_reason(change: Change, rows: int, says: str) -> None:
    found = discover(heated_tank(), _record(change, rows=rows))
    assert found.verdict.word == "insufficient" and found.verdict.effects == ()
    assert says in " ".join([found.verdict.reason, *found.verdict.notes])
    assert found.screening.reasons == found.verdict.shortcomings != () and found.search is None


def test_inputs_that_never_move_are_insufficient() -> None:
    still = tank_record(inputs=np.tile([1500.0, 10.0], (600, 1)))
    verdict = discover(heated_tank(), still).verdict
    assert verdict.word == "insufficient" and "power" in verdict.reason and "fan_speed" in verdict.reason


@pytest.mark.parametrize(
    ("change", "says", "lost"),
    [(_frozen, "frozen", range(201, 300)), (_clipped, "clipped at the highest", None), (_gap, "", range(250, 330))],
)
def test_what_can_not_be_used_is_left_out_and_the_rest_is_judged(change: Change, says: str, lost: range | None) -> None:
    """A plant without a missing effect: a fault of the sensor must not be given a name."""
    found = discover(heated_tank(), _record(change))
    assert found.verdict.word == "none", found.verdict
    assert says in " ".join(found.verdict.notes)
    missing = np.flatnonzero(np.isnan(found.screening.record.outputs[:, 0]))
    assert set(lost or ()) <= set(missing.tolist()) and len(missing) > 50


def test_a_few_outliers_change_nothing() -> None:
    record = tank_record()
    y = record.outputs[:, 0].copy()
    y[np.random.default_rng(2).choice(600, 12, replace=False)] += 5.0
    found = discover(heated_tank(), changed(record, y)).verdict
    assert found.word == "named" and found.effects[0].effect.site == "heat_loss"
    assert found.effects[0].effect.driver == "fan_speed"


def test_a_signal_that_repeats_itself_is_quantised_and_not_frozen() -> None:
    record = _record(lambda y: np.round(y))
    assert not screen(record, heated_tank()).notes


def test_an_input_that_hardly_moves_gives_no_driver(even: Dataset) -> None:
    checked = screen(even, heated_tank())
    assert checked.reasons == () and any("power hardly moves" in n for n in checked.notes)


def test_a_record_in_other_units_blames_nothing_but_the_sensor() -> None:
    """Degrees Celsius in a model of kelvin: a thermometer with a wrong zero is the one name that would be right."""
    record = _record(lambda y: y - 273.15, rows=300)
    verdict = discover(heated_tank(), record).verdict
    assert all((e.effect.site, e.effect.driver) == ("thermometer", "constant") for e in verdict.effects), verdict


def test_a_model_that_breaks_down_is_insufficient() -> None:
    def equations(m: Scope) -> None:
        t = m.state("temperature")
        m.derivative("temperature", m.site("heating", m.input("power") * ca.sqrt(t - 400.0)))
        m.output("temperature", t + m.parameter("loss"))

    model = replace(heated_tank(), equations=equations, outputs=heated_tank().outputs)
    found = discover(model, _record())
    assert found.verdict.word == "insufficient" and "can not simulate" in found.verdict.reason
    assert found.screening.reasons == found.verdict.shortcomings and found.model is model and found.before is None
