"""Discovery from end to end on a handful of records of the benchmark: kinds of records, not the share of right names.

The records are of a seed that no figure is published of.
"""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from adaptive_flot.discovery.discover import discover
from adaptive_flot.greybox.data.dataset import read_dataset
from adaptive_flot.processes import flotation
from benchmarks.hidden_effects.generate import record as generator
from benchmarks.hidden_effects.generate.folder import record_file, write_record
from benchmarks.hidden_effects.generate.record import Record
from benchmarks.hidden_effects.score.outcome import classify
from benchmarks.hidden_effects.score.verdict import SubmittedVerdict

SEED = 11


@cache
def made(k: int) -> Record:
    """A record, without what the nominal cell fitted to it predicts: half of the time, and no outcome depends on it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(generator, "_base", lambda experiment, done, measured: (done.clean, {}))
        return generator.make_record(SEED, k)


@pytest.mark.parametrize(
    ("k", "category", "rows", "outcomes"),
    [
        (1, "none", slice(1200), {"right"}),
        (2, "single", slice(600), {"right", "right_class"}),
        (4, "single", slice(1200, 2000), {"right", "right_class"}),
        (17, "fault", slice(1500), {"right", "tolerated"}),
    ],
)
def test_a_record_is_judged_as_its_answer_says(
    k: int, category: str, rows: slice, outcomes: set[str], tmp_path: Path
) -> None:
    """By the first rows, or those around its event, which tell as much as all."""
    record = made(k)
    assert record.answer.category == category
    write_record(tmp_path, replace(record, table=record.table.iloc[rows].reset_index(drop=True)))
    model = replace(flotation.make_model(), record_code=True)  # as the command does; less time with a compiler
    found = discover(model, read_dataset(record_file(tmp_path, record.name), model)).verdict
    told = json.loads(json.dumps(found.as_dict()))
    outcome = classify(record.answer.as_dict(), SubmittedVerdict.model_validate(told))
    assert outcome in outcomes, (found.word, [e.effect.label for e in found.effects], record.answer.effects)
    if found.effects:
        grade = told["error"]["concentrate_grade"]
        assert grade["after"] < 1.02 * grade["before"]


def test_a_record_may_start_anywhere_and_lose_a_sensor(tmp_path: Path) -> None:
    """Cut in the middle of a move, one meter frozen for half of the rest: the gate says so, and no name is wrong."""
    record = made(2)
    table = record.table.iloc[517:1217].reset_index(drop=True)
    meter = table["air_recovery"].to_numpy(dtype=float, copy=True)
    meter[350:] = meter[350]
    table["air_recovery"] = meter
    write_record(tmp_path, replace(record, table=table))
    model = replace(flotation.make_model(), record_code=True)  # as the command does; less time with a compiler
    found = discover(model, read_dataset(record_file(tmp_path, record.name), model)).verdict
    assert any("air_recovery" in note and "frozen" in note for note in found.notes)
    told = SubmittedVerdict.model_validate(json.loads(json.dumps(found.as_dict())))
    assert classify(record.answer.as_dict(), told) in ("right", "right_class", "abstained")
