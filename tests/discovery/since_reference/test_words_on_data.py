"""With several records or a reference, too: what is wrong with the data is said, and nothing stands in for an event."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.since_reference.changes import find_changes, unless_an_event
from adaptive_flot.greybox.data.dataset import Dataset
from tests.discovery.heated import NOISE, Truth, heated_tank, tank_record

EVENT = Truth(exponent=0.0, loss_step=0.5)
"""The loss becomes 50 % larger in the middle of the record, at 9000 s."""
PLAIN = Truth(exponent=0.0)


def named(name: str, record: Dataset) -> Dataset:
    return replace(record, name=name)


def test_a_lack_of_two_records_has_its_name_unless_one_alone_is_explained_by_an_event() -> None:
    """No hypothesis for several records begins at a time: a slow part or a dependence would stand in for it."""
    records = [named(f"record {seed}", tank_record(seed=seed)) for seed in (0, 1)]
    found = find_changes(heated_tank(), records)
    told = {(e.effect.site, e.effect.driver) for e in found.verdict.effects} | set(found.verdict.members)
    assert found.verdict.word in ("named", "class") and ("heat_loss", "fan_speed") in told, found.verdict.reason
    events = [named("event", tank_record(EVENT)), tank_record(EVENT, rows=300)]
    verdict = unless_an_event(found, heated_tank(), events, (), 1, lambda stage: None).verdict
    assert verdict.word == "abstain" and not verdict.effects
    assert "event alone says: " in verdict.reason and "Judge each record by itself" in verdict.reason


def test_nothing_is_told_of_two_records_that_start_far_from_rest_with_nothing_wrong() -> None:
    """The fit of the model as it is ended on its way, and heating that is 0 % larger explained the rest."""
    news = [named(f"new {seed}", tank_record(PLAIN, rows=300, seed=seed)) for seed in (7, 8)]
    for references in ([], [named("old", tank_record(PLAIN, seed=9))]):
        found = find_changes(heated_tank(), news, references)
        assert found.verdict.word in ("none", "abstain") and not found.verdict.effects, found.verdict.reason
        assert all(c.before < 1.2 * NOISE for c in found.verdict.error)
        if not references:  # nothing is left to explain, and so nothing is missing
            assert found.verdict.word == found.judged.word == "none", found.verdict.reason
            assert all(c.noise == pytest.approx(NOISE, rel=0.2) for c in found.verdict.error)


def test_beside_a_reference_a_sensor_that_stops_is_said_and_an_event_there_is_suspect() -> None:
    """The thermometer stands still for 25 minutes around the event; the record also came with a note."""
    new = tank_record(EVENT, seed=2)
    outputs = new.outputs.copy()
    outputs[275:325] = outputs[274]
    new = named("new", replace(new, outputs=outputs, notes=("a note of the file",)))
    verdict = find_changes(heated_tank(), [new], [named("old", tank_record(PLAIN, seed=3))]).verdict
    said = " ".join(verdict.notes)
    assert "new: temperature says nothing from" in said and "new: a note of the file" in said
    if verdict.effects:
        assert "suspect: " in said, verdict.reason


def test_beside_a_reference_several_records_say_that_events_were_not_looked_for() -> None:
    news = [named(f"new {seed}", tank_record(PLAIN, rows=300, seed=seed)) for seed in (4, 5)]
    verdict = find_changes(heated_tank(), news, [named("old", tank_record(PLAIN, seed=6))]).verdict
    assert verdict.word in ("none", "abstain") and not verdict.effects, verdict.reason
    assert any(note.startswith("Events in time were not looked for") for note in verdict.notes)
    assert not any("says nothing" in note for note in verdict.notes) and np.isfinite(news[0].outputs).all()
