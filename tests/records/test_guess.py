"""Tags are guessed by name, unit and size, and only where one reading is clearly best."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from adaptive_flot.errors import DataError
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.quantities import Quantity
from adaptive_flot.records.guess import guess_tags, name_score
from adaptive_flot.records.habits import complete_habits, holds_its_value, period
from adaptive_flot.records.reading.export import Export, Signal
from adaptive_flot.records.reading.raw import UnclearError
from adaptive_flot.records.tag_map import FileKeys, TagMap, TimeKeys

BASE = {"FIC_101.PV": ("L/min", 90.0), "FIC_102.PV": ("L/min", 10.0), "LIC_201.SP": ("mm", 380.0)}


Values = float | FloatArray


def signal(tag: str, unit: str, values: Values) -> Signal:
    found = np.full(200, values) if isinstance(values, float) else values
    time = (10.0 * 1e9 * np.arange(len(found))).astype(np.int64)
    return Signal(tag, unit, "", time, found, np.arange(len(found)))


def export(**more: tuple[str, Values]) -> Export:
    tags: dict[str, tuple[str, Values]] = {**BASE, **more}
    signals = {tag: signal(tag, unit, value) for tag, (unit, value) in tags.items()}
    return Export(Path("export.csv"), signals, FileKeys(), TimeKeys(column="Timestamp"), ())


def tags(model: Model, **more: tuple[str, Values]) -> dict[str, str]:
    found = guess_tags(export(**more), model, TagMap())
    return {name: f"{keys.tag} {keys.unit}" for name, keys in found.quantities.items()}


INPUTS = {"air_flow": "FIC_101.PV L/min", "feed_flow": "FIC_102.PV L/min", "level_setpoint": "LIC_201.SP mm"}


def test_two_flows_are_told_apart_by_their_size(model: Model) -> None:
    assert tags(model) == INPUTS


@pytest.mark.parametrize(
    ("tag", "unit", "value", "quantity"),
    [
        ("AI_401.PV", "%", 23.0, "concentrate_grade"),
        ("Conc Cu assay", "", 23.0, "concentrate_grade"),
        ("LIC_201.PV", "mm", 378.0, "level"),
        ("PulpLevel", "", 0.378, "level"),
        ("Tails flow", "L/min", 9.0, "tails_flow"),
        ("air_recovery", "%", 20.0, "air_recovery"),
    ],
)
def test_an_output_is_found_by_name_unit_and_size(
    model: Model, tag: str, unit: str, value: float, quantity: str
) -> None:
    found = tags(model, **{tag: (unit, value)})
    assert set(found) == {*INPUTS, quantity} and found[quantity].startswith(tag)


@pytest.mark.parametrize(
    ("tag", "unit", "value"),
    [
        ("TI_205.PV", "°C", 25.0),
        ("Feed Cu grade", "%", 1.2),
        ("Wash water", "L/min", 9.0),
        ("Motor current", "A", 12.0),
        ("PI_300.PV", "", 12.0),
    ],
)
def test_a_tag_of_something_else_is_left_alone(model: Model, tag: str, unit: str, value: float) -> None:
    assert tags(model, **{tag: (unit, value)}) == INPUTS


def test_a_measured_level_is_not_taken_for_its_set_point(model: Model) -> None:
    signals = export(**{"LIC_201.PV": ("mm", 378.0)})
    without = {tag: s for tag, s in signals.signals.items() if tag != "LIC_201.SP"}
    with pytest.raises(DataError, match="no tag found for the input level_setpoint"):
        guess_tags(Export(signals.file, without, signals.file_keys, signals.time_keys, ()), model, TagMap())


def test_two_tags_that_suit_equally_well_are_asked(model: Model) -> None:
    with pytest.raises(UnclearError) as caught:
        tags(model, **{"AI_401.PV": ("%", 23.0), "AI_402.PV": ("%", 24.0)})
    assert caught.value.section == "concentrate_grade"
    assert {c["tag"] for c in caught.value.choices} == {"AI_401.PV", "AI_402.PV"}


def test_what_the_map_says_is_kept_and_not_guessed_again(model: Model) -> None:
    known = TagMap().with_keys("concentrate_grade", {"tag": "AI_402.PV", "unit": "%"})
    found = guess_tags(export(**{"AI_401.PV": ("%", 23.0), "AI_402.PV": ("%", 24.0)}), model, known)
    assert found.quantities["concentrate_grade"].tag == "AI_402.PV"


def test_outputs_are_not_looked_for_where_the_map_names_all_inputs(model: Model) -> None:
    given = export(**{"AI_401.PV": ("%", 23.0)})
    assert set(guess_tags(given, model, TagMap(), outputs=False).quantities) == set(INPUTS)


@pytest.mark.parametrize(
    ("tag", "score"),
    [("LIC_201.SP", 1.0), ("Level setpoint", 1.0), ("LIC_201.PV", -0.5), ("FIC_101.SP", -1.0), ("Level", 0.5)],
)
def test_a_set_point_is_told_from_what_is_measured(tag: str, score: float) -> None:
    assert name_score(Quantity("level_setpoint", "m", ""), tag) == score


# -- habits ------------------------------------------------------------------------------------------------------------


def habits(model: Model, values: Values, tag: str = "AI_401.PV") -> dict[str, object]:
    given = export(**{tag: ("%", values)})
    found = complete_habits(given, model, guess_tags(given, model, TagMap()))
    return found.quantities["concentrate_grade"].model_dump(exclude={"tag", "unit"}, exclude_defaults=True)


def noisy(rows: int = 200) -> FloatArray:
    found: FloatArray = 23 + 0.1 * np.random.default_rng(0).standard_normal(rows)
    return found


def test_a_sound_signal_needs_nothing(model: Model) -> None:
    assert habits(model, noisy()) == {}


def test_an_analyser_that_holds_its_value_counts_only_what_is_new(model: Model) -> None:
    assert habits(model, np.repeat(noisy(20), 10)) == {"repeats": "drop"}


def test_a_sensor_that_stops_is_seen(model: Model) -> None:
    values = noisy()
    values[50:100] = values[50]
    assert habits(model, values) == {"frozen": "300 s"}


def test_a_constant_signal_is_no_sensor_that_stopped(model: Model) -> None:
    assert habits(model, np.full(200, 23.0)) == {}


def test_lone_values_far_from_all_others_are_dropped(model: Model) -> None:
    values = noisy()
    values[[30, 90]] = 60.0
    assert habits(model, values) == {"spikes": "drop"}


def test_a_number_of_loggers_outside_the_range_is_a_bad_code(model: Model) -> None:
    values = noisy()
    values[[30, 31, 90]] = -9999.0
    assert habits(model, values) == {"bad": ("-9999",)}


def test_a_column_of_words_is_no_signal(model: Model) -> None:
    given = export(**{"AI_401.PV": ("%", noisy())})
    words = {f"word {k}": 1 for k in range(30)}
    odd = Signal("AI_401.PV", "%", "", given.signals["AI_401.PV"].time, noisy(), np.arange(200), words)
    full = Export(given.file, {**given.signals, "AI_401.PV": odd}, given.file_keys, given.time_keys, ())
    with pytest.raises(DataError, match="has 30 texts among its numbers"):
        complete_habits(full, model, guess_tags(full, model, TagMap()))


def test_the_step_of_a_logger_in_whole_seconds_is_its_mean_one() -> None:
    time = (np.round(3.04 * np.arange(500)) * 1e9).astype(np.int64)
    step, regular = period(Signal("a", "", "", time, np.ones(500), np.arange(500)))
    assert regular and step == pytest.approx(3.04, rel=1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_a_clock_that_jitters_about_a_minute_has_a_step_of_a_minute(seed: int) -> None:
    """Else two records of one logger have two steps, and can not be compared."""
    rng = np.random.default_rng(seed)
    time = np.delete(60.0 * np.arange(1700) + rng.normal(0.0, 2.5, 1700), rng.choice(1700, 6, replace=False))
    stamps = (np.round(time) * 1e9).astype(np.int64)
    step, regular = period(Signal("a", "", "", stamps, np.ones(len(stamps)), np.arange(len(stamps))))
    assert regular and step == 60.0


def test_a_hole_does_not_change_the_step() -> None:
    time = (np.delete(10.0 * np.arange(500), range(100, 300)) * 1e9).astype(np.int64)
    assert period(Signal("a", "", "", time, np.ones(300), np.arange(300))) == (10.0, True)


def test_a_step_signal_and_noise_are_no_held_analyser() -> None:
    assert not holds_its_value(noisy()) and not holds_its_value(np.full(100, 3.0))


def test_a_tag_whose_name_has_a_unit_is_told_which_one_fits(model: Model) -> None:
    """The name of a record's column says its unit; the values say another one."""
    with pytest.raises(DataError) as caught:
        tags(model, concentrate_grade=("", 23.0))
    said = str(caught.value)
    assert "'concentrate_grade' is a fraction by its name" in said and "in % it would be 0.23" in said
    assert "concentrate_grade: {tag: concentrate_grade, unit: '%'}" in said
    with pytest.raises(DataError, match=r"'concentrate_flow_m3_s' is in m3/s by its name.* fits none") as caught:
        tags(model, concentrate_flow_m3_s=("", 1e3))
    assert "unit: m3/s" not in str(caught.value)
