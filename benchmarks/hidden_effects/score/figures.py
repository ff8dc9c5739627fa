"""From verdicts to figures: print, and write rows (CSV) and summary (JSON) beside the run."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path

from adaptive_flot.errors import DataError, near_match
from adaptive_flot.files import write_text
from benchmarks.hidden_effects.rivals import RIVALS
from benchmarks.hidden_effects.score.results import results_table, write_results
from benchmarks.hidden_effects.score.summary import as_json
from benchmarks.hidden_effects.score.tables import print_run, print_side_by_side


def discover_command() -> str:
    """Command template of the product that is installed beside this interpreter."""
    script = Path(sys.executable).with_name("adaptive-flot")
    # the records themselves run side by side, and nobody looks at their pages
    options = "--json {json} --processes 1 --no-report --out results/hidden-effects-last"
    return f"{shlex.quote(str(script))} discover {{record}} {options}"


def method_command(name: str) -> str:
    """Command template of a rival.

    Raises
    ------
    DataError
        There is none of that name.
    """
    if name not in RIVALS:
        raise DataError(f"--method {name}: no such rival; {near_match(name, RIVALS)}")
    answer = " --answer {answer}" if name == "oracle" else ""
    python = shlex.quote(sys.executable)
    return f"{python} -m benchmarks.hidden_effects rival {name} {{record}} --json {{json}}{answer}"


def finish(folder: Path, label: str, extra: Path | None, count: int | None = None) -> None:
    """Print a run and write its rows and its summary."""
    table = results_table(folder, label, count)
    write_results(folder, label, table)
    run = folder / "runs" / label
    summary = {"label": label, **json.loads((run / "run.json").read_text()), **as_json(table)}
    for file in filter(None, (run / "summary.json", extra)):
        write_text(file, json.dumps(summary, indent=1) + "\n")
    print_run(label, table)


def side_by_side(folder: Path, count: int | None = None) -> None:
    """Print every run of a folder.

    Raises
    ------
    DataError
        Nothing was run there.
    """
    labels = sorted(file.parent.name for file in (folder / "runs").glob("*/run.json"))
    tables = {label: results_table(folder, label, count) for label in labels}
    tables = {label: table for label, table in tables.items() if len(table)}
    if not tables:
        raise DataError(f"{folder}: no run to show; make one with `python -m benchmarks.hidden_effects score`")
    print_side_by_side(tables)
