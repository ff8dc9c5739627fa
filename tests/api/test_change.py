"""Protects: `af.discover` with references tells what has changed, shows it, draws it and writes it."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import pytest

import adaptive_flot as af
from adaptive_flot.api.changes import Change
from adaptive_flot.errors import ModelError
from tests.discovery.hypotheses import tank


@pytest.fixture(scope="module")
def change() -> Change:
    new, old = tank.record("new", 1, tank.DRAUGHT), tank.record("old", 2)
    return af.discover(tank.tank(), new, references=[tank.table(old)])


def test_what_has_changed_is_told_with_its_size(change: Change) -> None:
    assert change.verdict.word == "named" and change.verdict.reason.startswith("Heat loss is 65 % larger.")
    assert repr(change).startswith("new: named.")


def test_tables_tell_errors_and_what_was_tried(change: Change) -> None:
    after, before = (change.table[column].to_numpy(float)[0] for column in ("after", "before"))
    assert after < 0.1 * before
    best = change.hypotheses.to_dict("records")[0]
    assert (best["site"], best["kind"]) == ("heat_loss", "gain") and best["low"] > 0


def test_it_is_drawn_and_written(change: Change, tmp_path: Path) -> None:
    with mpl.rc_context():
        assert len(change.plot().axes) == 1
    assert "Heat loss is 65 % larger" in change.report(tmp_path / "r.html").read_text()


def test_limits_are_refused_where_no_test_is_proposed() -> None:
    record = tank.record("new", 1)
    with pytest.raises(ModelError, match="limits"):
        af.discover(tank.tank(), [record, record], limits={"power": (0.0, 1.0)})  # type: ignore[call-overload]
