"""What commands print fits 80 columns, and no column of a table is lost for it."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from adaptive_flot.console.lines import print_comparison, print_sentences
from adaptive_flot.console.tables import fitted, print_table
from adaptive_flot.report.compare.tables import compare_tables
from adaptive_flot.report.kit.parts import Table
from adaptive_flot.runner.commands.runs.run_files import write_json
from tests.cli.conftest import Call
from tests.report.test_compare import comparison
from tests.runner.commands.test_runs_table import closed_loop_summary

WIDTH = 80


def test_what_compare_prints_fits(call: Call, tmp_path: Path) -> None:
    write_json(tmp_path / "r" / "summary.json", closed_loop_summary(3))
    result = call("compare", "r")
    assert result.code == 0
    assert max(map(len, result.out.splitlines())) <= WIDTH


def test_a_comparison_keeps_the_columns_of_the_limit_and_whole_ranges(capsys: pytest.CaptureFixture[str]) -> None:
    print_comparison(compare_tables(comparison(8)), [])
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines())) <= WIDTH
    assert all(word in out.split() for word in ("Below", "limit", "time]", "Depth"))
    for table in compare_tables(comparison(8)):
        for row in table.rows:
            for cell in row[table.words :]:
                assert all(line in out for line in cell.split("\n")), cell


WORDS = st.text("abc123.", min_size=1, max_size=25)


@given(st.lists(WORDS, min_size=2, max_size=9), st.integers(60, 120))
def test_every_cell_is_printed_whole(cells: list[str], width: int) -> None:
    header = ("Estimator", *(f"h{i}" for i in range(len(cells) - 1)))
    content = Table("", header, (tuple(cells),))
    console = Console(width=width, file=None, record=True, quiet=False, force_terminal=False)
    with console.capture() as printed:
        print_table(console, content)
    text = printed.get()
    assert max(map(len, text.splitlines())) <= width
    assert all(cell in text for cell in cells)
    shown = [h for part in fitted(content, width) for h in part.header if h != "Estimator"]
    assert shown == list(header[1:])


def test_sentences_of_any_length_are_wrapped(capsys: pytest.CaptureFixture[str]) -> None:
    print_sentences(["word " * 60, "[bold] is text"])
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= WIDTH and lines[-1] == "[bold] is text"
