"""Protects: nothing is told as unchanged with constants that the reference itself excludes; and what a size rests on.

A tank heated by the difference of two powers, over a heat content: neither a covariance of these constants nor one of
their logarithms holds far away, so that a fit finds constants for which a heater with 15 % less power is no change.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from adaptive_flot.discovery.hypotheses import calibration
from adaptive_flot.discovery.hypotheses.procedure import OTHER_CONSTANTS, compare
from adaptive_flot.greybox import Effect, Model, Parameter, Scope
from tests.discovery.hypotheses import tank as heated
from tests.discovery.hypotheses.test_constants import AGED, record, tank


def too_many_constants() -> Model:
    """The tank, with a part of its power spilled at once."""

    def equations(m: Scope) -> None:
        temperature = m.state("temperature")
        heating = m.site("heater", m.parameter("power") * m.input("duty"), "actuator", unit="W")
        spilled = m.site("spill", m.parameter("spilled"), "process", unit="W") * m.input("duty")
        loss = m.site("loss", m.parameter("conductance") * (temperature - m.input("room")), "flow", unit="W")
        m.derivative("temperature", (heating - spilled - loss) / m.parameter("store"))
        m.output("temperature", m.site("thermometer", temperature, "sensor", "offset", unit="K"))

    def guess(name: str, value: float, unit: str) -> Parameter:
        return Parameter(name, value, unit, "", scale=value, role="estimated")

    constants = guess("power", 300.0, "W"), guess("spilled", 30.0, "W"), guess("conductance", 4.0, "W/K")
    return replace(tank(), parameters=(*constants, guess("store", 2000.0, "J/K")), equations=equations)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_change_that_only_excluded_constants_hide_is_not_told_as_none(
    monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    new, old = record(10 + seed, AGED), record(seed)
    found = compare(too_many_constants(), [new], [old]).verdict
    assert found.word != "none" and OTHER_CONSTANTS in found.notes
    # the covariance alone allows them: this is what the reference is asked for
    monkeypatch.setattr(calibration, "EXCLUDED", 1e12)
    assert compare(too_many_constants(), [new], [old]).verdict.word == "none"


@pytest.mark.parametrize("seed", [0, 1])
def test_nothing_new_is_nothing_with_too_many_constants_as_well(seed: int) -> None:
    found = compare(too_many_constants(), [record(10 + seed)], [record(seed)]).verdict
    assert found.word == "none" and OTHER_CONSTANTS not in found.notes


def test_a_size_in_the_unit_of_a_part_says_that_its_factor_is_open() -> None:
    """The tank's constants are told up to a factor: a limit of 120 W may be one of 1200 W, and 15 % are 15 %."""
    limited = Effect("heater", "saturation", "saturation", {"amplitude": 1.0, "limit": 120.0}, {"width": 1.0})
    in_watts = compare(tank(), [record(10, limited)], [record(0)]).verdict
    assert in_watts.word == "named" and "heater" in in_watts.reason.lower(), in_watts.reason
    assert any("only up to a factor: power, conductance, store" in note for note in in_watts.notes), in_watts.notes
    in_shares = compare(tank(), [record(11, AGED)], [record(1)])
    assert [t.hypothesis and t.hypothesis.kind for t in in_shares.judged.parts] == ["gain"]
    assert not any("only up to a factor" in note for note in in_shares.verdict.notes)


def test_a_size_in_the_unit_of_a_part_says_that_a_constant_has_ended_where_its_range_does() -> None:
    """The heater's efficiency is 0.8: where it may not be above 0.7, watts at the heater are too few."""
    model = heated.tank()
    efficiency, loss = model.parameters
    limited = Effect("heater", "saturation", "saturation", {"amplitude": 1.0, "limit": 1000.0}, {"width": 1.0})
    new, old = heated.record("new", 1, limited), heated.record("old", 2)
    said = []
    for upper in (0.7, 1.5):
        efficiency = replace(efficiency, value=0.65, upper=upper)
        found = compare(replace(model, parameters=(efficiency, loss)), [new], [old]).verdict
        assert found.word == "named" and "does not go above" in found.reason, found.reason
        said.append([note for note in found.notes if "efficiency is fitted at the upper end of its range, 0.7" in note])
    assert [len(notes) for notes in said] == [1, 0]
