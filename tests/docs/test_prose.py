"""The documents can be read: short sentences, and a README of at most 200 lines."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.docs.pages import PROSE, ROOT, name_of
from tests.docs.prose import MOST_WORDS, sentences, too_long, words


@pytest.mark.parametrize("page", PROSE, ids=name_of)
def test_no_sentence_is_too_long(page: Path) -> None:
    assert too_long(page.read_text(encoding="utf-8")) == []


def test_the_readme_has_at_most_200_lines() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 200


def test_contributing_has_at_most_60_lines() -> None:
    assert len((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").splitlines()) <= 60


LONG = " ".join(["word"] * (MOST_WORDS + 1))


@pytest.mark.parametrize("page", [f"{LONG}.", f"- {LONG}.", f"Short. And {LONG}.", f"term\n: {LONG}", f"*{LONG}*."])
def test_a_long_sentence_is_seen(page: str) -> None:
    assert len(too_long(page)) == 1


@pytest.mark.parametrize(
    "page", [f"| {LONG} |", f"```sh\n{LONG}\n```", f"<!-- {LONG} -->", f"`{LONG}` is code.", f"$$\n{LONG}\n$$"]
)
def test_tables_code_comments_and_equations_are_no_prose(page: str) -> None:
    assert too_long(page) == []


def test_sentences_end_where_they_end() -> None:
    page = "One ends (here.) `code` begins two. Is this three? [Four](there.md) ends.\n\n- five\n- six 0.5 % e.g. this"
    assert len(sentences(page)) == 6
    assert [words(s) for s in sentences(page)][-2:] == [1, 4]
