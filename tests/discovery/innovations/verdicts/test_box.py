"""The heated box: what is told of a lid that someone opens, on a process that is not flotation."""

from dataclasses import replace
from typing import Any

import pytest

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.hypotheses.telling import verdict_of
from adaptive_flot.discovery.since_reference.changes import find_changes
from tests.discovery.innovations.box import DT, LIDS, model, record


def test_an_opened_lid_is_a_loss_that_is_switched_at_its_times() -> None:
    """The lid's log is not known to the search; a free curve in time at the thermometer is not the answer."""
    verdict = discover(model(), record()).verdict
    assert verdict.word in ("named", "class"), verdict.reason
    switch = next(e.effect for e in verdict.effects if e.effect.driver == "time")
    assert (switch.site, switch.form) == ("loss", "switch")
    for k, (a, b) in enumerate(LIDS, start=1):
        on, duration = switch.coefficients[f"on_{k}"], switch.coefficients[f"for_{k}"]
        assert on == pytest.approx(a, abs=1.5 * DT) and on + duration == pytest.approx(b, abs=1.5 * DT)
    assert "times as large while something is switched" in verdict.reason
    assert verdict.error[0].after < 0.3 * verdict.error[0].before


def test_nothing_is_named_where_the_box_stayed_closed() -> None:
    verdict = find_changes(model(), [record((), seed=1)], [record((), seed=2)]).verdict
    assert verdict.word not in ("named", "class"), verdict.reason


def test_an_opened_lid_is_told_against_a_closed_reference() -> None:
    verdict = find_changes(model(), [record(seed=3)], [record((), seed=2)]).verdict
    told = {e.effect.site for e in verdict.effects} | {site for site, _ in verdict.members}
    assert verdict.word in ("named", "class") and "loss" in told and told <= {"loss", "other_heat"}, verdict.reason
    assert verdict.error[0].after < 0.3 * verdict.error[0].before and verdict.error[0].reduction95[0] > 0


def test_an_event_is_not_told_where_no_error_is_unusual(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same lid, with a reference nearly as noisy as the record: there is nothing for an event to explain."""

    def as_noisy(*given: Any) -> Any:
        verdict = verdict_of(*given)
        return replace(verdict, error=tuple(replace(c, noise=0.8 * c.before) for c in verdict.error))

    monkeypatch.setattr("adaptive_flot.discovery.innovations.verdicts.event.verdict_of", as_noisy)
    # neither in a free run nor over stretches
    monkeypatch.setattr(
        "adaptive_flot.discovery.innovations.verdicts.cause.usual_over_folds", lambda *given: {"thermometer": 10.0}
    )
    verdict = find_changes(model(), [record(seed=3)], [record((), seed=2)]).verdict
    assert all(e.effect.form != "switch" for e in verdict.effects)
    assert not any(note.startswith("One change over the whole record") for note in verdict.notes)
