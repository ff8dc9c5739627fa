"""Protects: what is said of free runs beside process noise is what they say."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from adaptive_flot.discovery.innovations.verdicts.cause import _as_well


@pytest.mark.parametrize(
    ("word", "sites", "said"),
    [
        ("named", {"pump"}, "say so, too"),
        ("class", {"pump", "valve"}, "say so, too"),
        ("named", {"valve"}, "say something else"),
        ("abstain", set(), "do not tell it. They say"),
        ("none", set(), "do not tell it. They say"),
    ],
)
def test_free_runs_agree_differ_or_are_silent(word: str, sites: set[str], said: str) -> None:
    """A steering gear that free runs told, too, was said not to be told by them."""
    compared = SimpleNamespace(verdict=SimpleNamespace(word=word, sites=frozenset(sites)))
    told = SimpleNamespace(effects=(SimpleNamespace(site="pump"),))
    assert _as_well(compared, told) == said  # type: ignore[arg-type]
