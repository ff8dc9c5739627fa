"""Put the comparison of closed loops into its page.

Command: `python -m benchmarks.pictures.readme_table results/a results/b ...`.

The results are folders that `adaptive-flot run` wrote, one or more a scenario. What stands between the two marks in
docs/results/closed_loop.md is replaced by the overview that `adaptive-flot compare` prints.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from adaptive_flot.errors import ResultError
from adaptive_flot.files import write_text
from adaptive_flot.report.compare.tables import markdown, overview_table
from adaptive_flot.runner.commands.comparison import compare
from adaptive_flot.runner.commands.runs.runs_table import read_runs

PAGE = Path(__file__).parents[2] / "docs" / "results" / "closed_loop.md"
BEGIN = "<!-- comparison: begin, written by `python -m benchmarks.pictures.readme_table` -->"
END = "<!-- comparison: end -->"


def table_text(results: Sequence[Path]) -> str:
    """The overview of several results in Markdown, without its caption.

    Raises
    ------
    ResultError
        There are not at least two scenarios with economics.
    """
    overview = overview_table(compare(read_runs(results)))
    if overview is None:
        raise ResultError("the page compares several closed-loop scenarios; give a result of each")
    return markdown(overview).split("\n\n", 1)[1].strip()


def put(text: str, table: str) -> str:
    """Replace what stands between the marks."""
    before, rest = text.split(BEGIN)
    return f"{before}{BEGIN}\n\n{table}\n\n{END}{rest.split(END)[1]}"


if __name__ == "__main__":
    write_text(PAGE, put(PAGE.read_text(encoding="utf-8"), table_text([Path(name) for name in sys.argv[1:]])))
