"""Discovery on measured data and on the shared examples: `python -m benchmarks.real_records.measured [FOLDER]`.

FOLDER holds `examples/` (records with answers beside them) and `data/` (measured records); default ../shared beside the
repository. Nothing of it is part of the repository. Every verdict is printed, whatever it is; nothing is tuned to it.
The cascaded tanks are in `benchmarks.real_records`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from adaptive_flot.discovery.results import Verdict
from adaptive_flot.parallel import available_processes
from adaptive_flot.processes.registry import make_model
from adaptive_flot.runner.commands.discover import discover_file

SHARED = Path(__file__).parents[2].parent / "shared"


@dataclass(frozen=True)
class MeasuredRecord:
    """A record, the model to judge it with, and the right answer where there is one."""

    name: str
    path: Path
    model: str
    answer: str
    right: frozenset[tuple[str, str]] = frozenset()

    def judge(self, verdict: Verdict) -> str:
        """Whether a verdict is the answer: its word, and the site and driver of each effect."""
        if not self.answer:
            return ""
        named = {(e.effect.site, e.effect.driver) for e in verdict.effects}
        right = named <= self.right and bool(named) == (self.answer == "named")
        return "yes" if right and verdict.word == self.answer else "no"


def records(folder: Path) -> Iterator[MeasuredRecord]:
    """Everything the folder holds."""
    answers = folder / "examples" / "answers.json"
    for name, answer in json.loads(answers.read_text()).items() if answers.is_file() else ():
        right = {(s, d) for s in answer.get("site", ()) for d in answer.get("driver", ())}
        yield MeasuredRecord(
            name, folder / "examples" / f"{name}.csv", "flotation", answer["verdict"], frozenset(right)
        )
    data = folder / "data"
    yield MeasuredRecord("zinc cell", data / "flotation-cell-zinc" / "flotation-cell.csv", "zinc-level", "insufficient")


def main(folder: Path) -> int:
    """Judge and print; 2 where there is nothing to judge."""
    present = [record for record in records(folder) if record.path.is_file()]
    if not present:
        print(
            f"{folder}: no examples/ and no data/ there; give their folder: "
            "python -m benchmarks.real_records.measured FOLDER"
        )
        return 2
    table = Table("record", "verdict", "effects", "first output: before -> after (noise)", "ok", "s", show_lines=True)
    console = Console(width=None if Console().is_terminal else 150)
    for record in present:
        v = discover_file(record.path, make_model(record.model), processes=available_processes()).verdict
        console.print(f"{record.name}: {v.reason}", highlight=False, markup=False)
        effects = "; ".join(f"{e.effect.site} by {e.effect.driver}" for e in v.effects)
        error = next((f"{c.before:.4g} -> {c.after:.4g} ({c.noise:.2g}) {c.unit}" for c in v.error), "")
        table.add_row(record.name, v.word, effects, error, record.judge(v), f"{v.seconds:.0f}")
    console.print(table)
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else SHARED))
