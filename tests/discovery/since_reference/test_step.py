"""Protects: one step that alone brings a free run back to its usual errors is told, and only where no other does.

Process noise is left out here: `with_step` is for records where it explains what has happened.
"""

from __future__ import annotations

import time
from dataclasses import replace

import pytest

from adaptive_flot.discovery.hypotheses.procedure import Comparison, compare
from adaptive_flot.discovery.since_reference import step as steps
from adaptive_flot.discovery.since_reference.step import with_step
from adaptive_flot.greybox import Effect
from tests.discovery.hypotheses.tank import DRAUGHT, record, tank

BEGINS = 6000.0


def step(site: str, size: float, mode: str) -> Effect:
    told = {"amplitude": size, "on_1": BEGINS, "for_1": 1e7}
    return Effect(site, "time", "switch", told, {"count": 1.0, "width": 10.0}, mode=mode)  # type: ignore[arg-type]


def untold(*effects: Effect) -> Comparison:
    """A record beside a reference, compared by single faults of the whole record, and not told."""
    found = compare(tank(), [record("new", 1, *effects)], [record("old", 2)])
    verdict = replace(found.verdict, word="abstain", reason="not told.", effects=(), members=())
    return replace(found, verdict=verdict, judged=replace(found.judged, word="abstain"))


def told(compared: Comparison) -> Comparison:
    return with_step(compared, 1, float("inf"))


def test_a_loss_that_steps_up_is_told_with_its_time_and_size_and_what_the_model_has_no_site_for_beside_it() -> None:
    verdict = told(untold(step("heat_loss", 0.4, "factor"))).verdict
    assert verdict.word in ("named", "class"), verdict.reason
    (effect,) = verdict.effects
    assert effect.effect.site == "heat_loss" and effect.effect.driver == "time"
    assert effect.effect.coefficients["on_1"] == pytest.approx(BEGINS, abs=200.0)
    assert effect.effect.coefficients["amplitude"] == pytest.approx(0.4, abs=0.1)
    assert all(c.after < 1.5 * c.noise for c in verdict.error)


def test_nothing_is_told_of_two_steps_nor_where_a_fault_of_the_whole_record_does_as_well() -> None:
    twice = untold(step("heat_loss", 0.4, "factor"), replace(step("thermometer", 2.0, "offset"), coefficients={
        "amplitude": 2.0, "on_1": 3000.0, "for_1": 1e7}))  # fmt: skip
    assert told(twice).verdict.word == "abstain"
    whole = untold(DRAUGHT)
    assert told(whole) is whole


def test_nothing_is_looked_for_where_errors_are_usual_or_the_time_is_up() -> None:
    usual, late = untold(), untold(step("heat_loss", 0.4, "factor"))
    assert told(usual) is usual
    assert with_step(late, 1, time.monotonic()) is late


def test_a_step_that_comes_near_and_makes_another_error_larger_is_a_note(monkeypatch: pytest.MonkeyPatch) -> None:
    """Measured: half of a cell's cooling was lost, and the voltage fitted a little worse with that."""
    monkeypatch.setattr(steps, "with_hypotheses", lambda compared, *given: compared)
    verdict = told(untold(step("heat_loss", 0.4, "factor"))).verdict
    assert verdict.word == "abstain"
    assert verdict.notes[-1].startswith("One step in time comes near, and is not told: heat loss ")
