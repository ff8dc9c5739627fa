"""An event that seems to begin where a sensor says nothing is marked; one elsewhere is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.record.screening import FROZEN_ROWS, Suspect, _frozen, clean_outputs
from adaptive_flot.discovery.verdict.words.suspects import suspect_notes
from adaptive_flot.greybox.effects import Effect
from tests.discovery.heated import Truth, heated_tank, tank_record

FROZEN = Suspect(5000.0, 6000.0, "temperature says nothing")


def _step(onset: float) -> Effect:
    return Effect("heat_loss", "time", "step", {"amplitude": 0.2, "onset": onset})


@pytest.mark.parametrize(("onset", "said"), [(4000.0, False), (4900.0, True), (5500.0, True), (6200.0, False)])
def test_an_onset_beside_or_within_a_suspect_part_is_told(onset: float, said: bool) -> None:
    notes = suspect_notes([_step(onset)], [FROZEN], dt=30.0)
    assert bool(notes) == said
    if said:
        assert notes[0] == f"suspect: heat_loss changes at {onset:g} s, where {FROZEN}"


def test_a_curve_is_judged_where_it_moves_most_and_a_dependence_not_at_all() -> None:
    values = {"value_1": 0.0, "value_2": 0.01, "value_3": 0.5}
    late = Effect("heat_loss", "time", "curve", values, {"knots": (0.0, 4500.0, 9000.0)})
    early = replace(late, coefficients={"value_1": 0.5, "value_2": 0.01, "value_3": 0.0})
    assert suspect_notes([late], [FROZEN], 30.0) and not suspect_notes([early], [FROZEN], 30.0)
    by_fan = Effect("heat_loss", "fan_speed", "power", {"exponent": 0.6}, {"reference": 10.0})
    assert suspect_notes([by_fan], [FROZEN], 30.0) == ()


def test_a_slow_curve_that_turns_has_not_stopped_where_its_rounded_values_stay() -> None:
    """The temperature of water over two days, in steps of 0.01 K. A sensor that stops there jumps when it goes on."""
    time = np.arange(2160) * 120.0
    water = np.round(15 + 2.0 * np.sin(2 * np.pi * time / 172_800), 2)
    runs = np.diff(np.flatnonzero(np.diff(np.concatenate([[-1.0], water, [-1.0]]))))
    assert runs.max() >= FROZEN_ROWS  # it does stay
    assert not _frozen(water).any()
    stopped = water.copy()
    stopped[400:480] = stopped[400]
    assert _frozen(stopped)[410:470].all()
    rest = water.copy()
    rest[2000:] = rest[2000]  # and does not come back
    assert _frozen(rest)[2010:].all()


def test_what_is_frozen_missing_or_stands_still_becomes_a_suspect_part() -> None:
    record = tank_record(Truth(exponent=0.0), 600)
    y, u = record.outputs.copy(), record.inputs.copy()
    y[100:160, 0] = y[100, 0]
    y[300:340, 0] = np.nan
    u[:, 1] += 0.1 * np.random.default_rng(0).standard_normal(600)
    u[400:440, 1] = np.median(u[:, 1])
    cleaned, notes, suspects = clean_outputs(replace(record, outputs=y, inputs=u), heated_tank())
    assert [s.what for s in suspects] == ["temperature says nothing"] * 2 + ["fan_speed stands still"]
    assert [round(s.start / 30) - 1 for s in suspects] == [101, 300, 401]
    assert np.isnan(cleaned.outputs[101:160, 0]).all() and any("had stopped?" in n for n in notes)


def test_an_input_that_rests_at_zero_between_both_signs_is_no_suspect() -> None:
    """A battery at rest has no current, and its sensor has not stopped."""
    record = tank_record(Truth(exponent=0.0), 600)
    u = record.inputs.copy()
    u[:, 1] = np.random.default_rng(0).standard_normal(600)
    u[400:440, 1] = 0.0
    assert clean_outputs(replace(record, inputs=u), heated_tank())[2] == ()


def test_a_few_rows_that_were_lost_are_a_suspect_part_and_many_are_not() -> None:
    """What begins just there may be the logger."""
    record = tank_record(Truth(exponent=0.0), 600)
    few, many = record.outputs.copy(), record.outputs.copy()
    few[200:202], many[::20] = np.nan, np.nan
    (there,) = clean_outputs(replace(record, outputs=few), heated_tank())[2]
    assert str(there) == f"no row was recorded from {record.time[200]:g} to {record.time[201]:g} s"
    assert clean_outputs(replace(record, outputs=many), heated_tank())[2] == ()


def test_an_input_that_is_moved_in_long_steps_has_not_stopped() -> None:
    """Nearly every row lies in a long run: the steps between the runs are no signal that changes from row to row."""
    record = tank_record(Truth(exponent=0.0), 600)
    u = record.inputs.copy()
    u[:, 1] = np.repeat([8.0, 20.0, 12.0, 16.0], [230, 230, 40, 100])
    assert clean_outputs(replace(record, inputs=u), heated_tank())[1:] == ((), ())


def test_an_output_outside_its_range_gets_a_word() -> None:
    """Degrees Celsius where the model says kelvin; no factor puts that right."""
    model = heated_tank()
    ranged = replace(model, outputs=(replace(model.outputs[0], lower=273.0, upper=373.0),))
    record = tank_record(Truth(exponent=0.0), 600)
    celsius = replace(record, outputs=record.outputs - 273.15)
    assert "check its unit and its zero" in clean_outputs(celsius, ranged)[1][0]
    assert clean_outputs(record, ranged)[1] == ()


@pytest.mark.parametrize(("stops", "told"), [(3, 3), (4, 0)])
def test_an_input_that_stands_still_often_is_held_and_its_sensor_has_not_stopped(stops: int, told: int) -> None:
    """The pitch that a turbine asks for stays where it is while the speed is right."""
    record = tank_record(Truth(exponent=0.0), 900)
    u = record.inputs.copy()
    u[:, 1] = np.random.default_rng(0).standard_normal(900)
    for k in range(stops):
        u[100 + 200 * k : 140 + 200 * k, 1] = 0.1 * (k + 1)
    assert len(clean_outputs(replace(record, inputs=u), heated_tank())[2]) == told
