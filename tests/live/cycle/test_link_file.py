"""Tags in the plant's units come to the same as tags in the model's."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
import yaml

from adaptive_flot.errors import AdaptiveFlotError
from adaptive_flot.live.link.cycle import Cycle
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.link_keys import LiveTag, Scale
from adaptive_flot.live.plant.link_text import link_text
from adaptive_flot.live.program import live
from adaptive_flot.plugins import DEFAULT_ESTIMATOR
from adaptive_flot.runner.scenario.keys import Plugin
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.scenario import Scenario


@pytest.mark.parametrize(
    ("unit", "tag", "model"), [("L/min", 90.0, 1.5e-3), ("m3/s", 1.5e-3, 1.5e-3), (None, 2.0, 2.0)]
)
def test_a_value_goes_there_and_back(unit: str | None, tag: float, model: float) -> None:
    scale = Scale.of(unit, "m3/s")
    assert scale.model(tag) == pytest.approx(model, rel=1e-12)
    assert scale.tag(scale.model(tag)) == pytest.approx(tag, rel=1e-12)


def test_a_unit_with_an_offset() -> None:
    assert Scale.of("degC", "K").model(20.0) == pytest.approx(293.15)


def test_the_models_own_unit_changes_no_bit() -> None:
    assert Scale.of("m3/s", "m3/s") == Scale()


def test_rules_are_in_the_models_unit() -> None:
    tag = LiveTag(tag="FIC", unit="L/min", range=(0.0, 120.0), jump=6.0, bad=("-9999", "Bad Input"), frozen="1 min")
    rules = tag.rules(Scale.of("L/min", "m3/s"), -1.0, 1.0)
    assert [rules.low, rules.high, rules.largest_jump] == pytest.approx([0.0, 2e-3, 1e-4])
    assert list(rules.bad) == pytest.approx([-9999 / 60000])
    assert (rules.frozen_after_s, rules.stale_after_s) == (60.0, 10.0)


def test_a_bad_code_is_found_in_the_tags_unit(write_link: Callable[..., Link], scenario: Scenario) -> None:
    """A code goes through the same arithmetic as the value, so that the two are equal to the bit."""
    link = write_link(scenario, {"tags.air_flow": {"tag": "air_flow", "unit": "L/min", "bad": [-9999]}})
    scale = Scale.of("L/min", "m3/s")
    assert scale.model(-9999.0) in link.file.tags["air_flow"].rules(scale, 0.0, 1.0).bad


def test_a_link_that_names_no_estimator_has_the_default_one(
    write_link: Callable[..., Link], write_live_scenario: Callable[[Mapping[str, object]], Scenario], scenario: Scenario
) -> None:
    """Also where the scenario does not have it; with the scenario's options where it does. A name given is kept."""
    link = write_link(scenario, {"estimator": ..., "controller": "pi"})
    assert link.file.estimator == DEFAULT_ESTIMATOR
    assert link.scenario.file.estimators[DEFAULT_ESTIMATOR] == Plugin(use=DEFAULT_ESTIMATOR)
    assert type(Cycle(link).estimation.estimator).__name__ == "AdaptiveImm"
    mine = Plugin(use=DEFAULT_ESTIMATOR, options={"plausible": 0.3})
    own = write_live_scenario({f"estimators.{DEFAULT_ESTIMATOR}": mine.model_dump()})
    assert write_link(own, {"estimator": ...}).scenario.file.estimators[DEFAULT_ESTIMATOR] == mine
    named = write_link(own, {"estimator": "rpem"})
    assert named.file.estimator == "rpem" and named.scenario.file == own.file


def test_a_written_link_names_the_default_estimator_where_a_case_has_it(tmp_path: Path) -> None:
    """In `undeclared_effect` it is not in the first case."""
    for name in ("undeclared_effect", "closed_loop_drift"):
        text = link_text(load_scenario(name), "opc.tcp://127.0.0.1:4840/", tmp_path)
        assert yaml.safe_load(text)["estimator"] == DEFAULT_ESTIMATOR


MAP = """\
time: {column: Timestamp, zone: Europe/London}
grid: {step: 1 s, hold_at_most: 3 s}
air_flow: {tag: FIC_101.PV, unit: L/min, bad: [Bad Input, -9999]}
feed_flow: {tag: FIC_102.PV, unit: L/min}
level_setpoint: {tag: LIC_201.SP, unit: mm}
concentrate_grade: {tag: AI_401.PV, unit: "%", delay: 90 s, range: [0, 60]}
"""


def test_the_map_of_an_import_gives_the_tags(
    write_link: Callable[..., Link], scenario: Scenario, tmp_path: Path
) -> None:
    """What the link file says of a tag goes before the map, key by key."""
    (tmp_path / "plant.map.yaml").write_text(MAP)
    own = {"concentrate_grade": {"stale": "5 min", "range": [5, 60]}}
    tags = write_link(scenario, {"map": str(tmp_path / "plant.map.yaml"), "tags": own}).file.tags
    air, grade = tags["air_flow"], tags["concentrate_grade"]
    assert (air.tag, air.unit, air.bad) == ("FIC_101.PV", "L/min", ("Bad Input", "-9999"))
    assert (grade.tag, grade.delay_s, grade.range, grade.stale) == ("AI_401.PV", 90.0, (5.0, 60.0), "5 min")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("tag: FIC_102.PV, unit: L/min", "constant: 10, unit: L/min", "as a constant, which a running plant does not"),
        (", unit: mm", "", "gives no unit for 'level_setpoint'"),
        ("unit: mm", "unit: kg", "tags.level_setpoint: unit 'kg' can not be converted"),
        ("feed_flow: {tag: FIC_102.PV, unit: L/min}\n", "", "'feed_flow' has no tag"),
        ("feed_flow:", "fed_flow:", "the model has no 'fed_flow'"),
        ("zone: Europe/London", "zone: Europe/Londn", "line 1: time.zone: no time zone"),
    ],
)
def test_a_map_that_does_not_do_for_a_link_is_one_line(
    write_link: Callable[..., Link], scenario: Scenario, tmp_path: Path, old: str, new: str, said: str
) -> None:
    assert old in MAP
    (tmp_path / "plant.map.yaml").write_text(MAP.replace(old, new))
    with pytest.raises(AdaptiveFlotError, match=said) as caught:
        write_link(scenario, {"map": str(tmp_path / "plant.map.yaml"), "tags": {}})
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"estimator": "rpm"}, "has no estimator 'rpm'; did you mean 'rpem'?"),
        ({"controller": "hld"}, "has no controller 'hld'; did you mean 'hold'?"),
        ({"scenario": "nowhere"}, "scenario: .*nowhere: no such scenario file"),
    ],
)
def test_what_a_link_file_names_wrongly_is_told_with_the_file(
    write_link: Callable[..., Link], scenario: Scenario, changes: dict[str, str], said: str
) -> None:
    with pytest.raises(AdaptiveFlotError, match=rf"link\.yaml: .*{said}"):
        write_link(scenario, changes)


def test_a_database_that_can_not_be_used_is_told_with_the_link_file(
    write_link: Callable[..., Link], scenario: Scenario
) -> None:
    bad = write_link(scenario, {"database": "no database", "controller": "pi"})
    with pytest.raises(AdaptiveFlotError, match=r"link\.yaml: database: can not be used"):
        live(bad, cycles=1)
