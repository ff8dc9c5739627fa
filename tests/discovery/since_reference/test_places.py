"""Protects: where nothing is told at a site, what has begun where the model has none is said, and never named."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.judgement import Word
from adaptive_flot.discovery.hypotheses.procedure import Comparison, compare
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.results import OutputChange, Verdict
from adaptive_flot.discovery.since_reference import places
from tests.discovery.innovations.verdicts.test_without_a_site import VOLUME, basin, record

NOTHING = "no single hypothesis makes the errors smaller"


def searched(fresh: float) -> tuple[Comparison, Search, Explanation]:
    """A basin into which so much [g/s] is lost from 2000 to 4000 s, since a healthy record."""
    new, old = record(12, fresh=fresh), record(2)
    with np.errstate(all="ignore"):
        compared = compare(basin(), [new], [old])
        known, columns = compared.calibration.constants, compared.rows.columns
        search = Search(basin(), new, columns, compared.calibration.noise, known.names, known, since_reference=True)
        return compared, search, search.base(basin().parameter_values)


def test_salt_that_is_lost_where_the_model_has_no_site_is_said_with_its_size_and_times() -> None:
    compared, search, base = searched(6.0)
    with np.errstate(all="ignore"):
        words = places.nearest_without_a_site(compared, search, base, [base])
    said = re.match(r"something takes (\S+) g/L/s from the balance of salt \((\d+)-(\d+) s\)", words[0])
    assert said is not None, words
    assert float(said[1]) == pytest.approx(6.0 / VOLUME, rel=0.1)
    assert [float(t) for t in said.groups()[1:]] == pytest.approx([2000.0, 4000.0], abs=100.0)


def test_where_a_site_explains_more_nothing_is_said_of_a_place() -> None:
    compared, search, base = searched(6.0)
    better = replace(base, numbers=-10_000)  # the criterion charges numbers
    with np.errstate(all="ignore"):
        assert places.nearest_without_a_site(compared, search, base, [base, better]) == []


def test_of_a_healthy_basin_nothing_is_said() -> None:
    compared, search, base = searched(0.0)
    with np.errstate(all="ignore"):
        assert places.nearest_without_a_site(compared, search, base, [base]) == []


@dataclass(frozen=True)
class Compared:
    """What is asked of a comparison."""

    verdict: Verdict
    calibration: Any = field(default_factory=SimpleNamespace)


@pytest.mark.parametrize(
    ("word", "before", "said"),
    [
        ("abstain", 5.0, True),
        ("abstain", 1.5, False),  # errors are about those of the reference: there is little to explain
        ("named", 5.0, False),
        ("none", 5.0, False),
    ],
)
def test_a_place_is_said_where_nothing_is_told_and_much_is_off(
    monkeypatch: pytest.MonkeyPatch, word: Word, before: float, said: bool
) -> None:
    monkeypatch.setattr(places, "nearest_without_a_site", lambda *given: ["something takes 1 m3/s"])
    error = (OutputChange("level", "m", before, before, 1.0, (0.0, 0.1)),)
    given: Any = Compared(Verdict(word, NOTHING, error=error))
    search: Any = SimpleNamespace(time_is_up=False)
    base: Any = None
    found = places.with_what_is_nearest(given, search, base, []).verdict
    assert found.word == word and not found.effects and not found.members
    assert ("as if something takes 1 m3/s: the model has no site" in found.reason) == said
    assert any(NOTHING in note for note in found.notes) == said
