"""Discovery from end to end on a handful of records of the benchmark: kinds of records, not the share of right names.

The records are of a seed that no figure is published of.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from adaptive_flot.discovery.discover import discover
from adaptive_flot.greybox.dataset import read_dataset
from adaptive_flot.processes import flotation
from benchmarks.hidden_effects.generate import record_file, write_record
from benchmarks.hidden_effects.outcome import classify
from benchmarks.hidden_effects.record import make_record
from benchmarks.hidden_effects.verdict import Verdict

SEED = 11


@pytest.mark.parametrize(
    ("k", "category", "outcomes"),
    [
        (1, "none", {"right"}),
        (2, "single", {"right", "right_class"}),
        (4, "single", {"right", "right_class"}),
        (17, "fault", {"right", "tolerated"}),
    ],
)
def test_a_record_is_judged_as_its_answer_says(k: int, category: str, outcomes: set[str], tmp_path: Path) -> None:
    record = make_record(SEED, k)
    assert record.answer.category == category
    write_record(tmp_path, record)
    model = flotation.make_model()
    found = discover(model, read_dataset(record_file(tmp_path, record.name), model)).verdict
    told = json.loads(json.dumps(found.as_dict()))
    outcome = classify(record.answer.as_dict(), Verdict.model_validate(told))
    assert outcome in outcomes, (found.word, [e.effect.label for e in found.effects], record.answer.effects)
    if found.effects:
        grade = told["error"]["concentrate_grade"]
        assert grade["after"] < 1.02 * grade["before"]
