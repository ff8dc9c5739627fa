"""False alarms on measured records: two records of one plant that nobody changed, one as the reference of the other.

The models lack physics that these plants have. That is so on both records, so it has not changed. `none` and `abstain`
are right, and a name or a class is a false alarm. Command: `python -m benchmarks.real_records.unchanged`.
"""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from rich.console import Console
from rich.table import Table

from adaptive_flot.discovery.since_reference.changes import find_changes
from adaptive_flot.greybox import Dataset, Model
from adaptive_flot.parallel import available_processes
from adaptive_flot.processes import cascaded_tanks
from benchmarks.real_records import air_handling_unit, electric_drives, heat_exchanger, lamp
from benchmarks.real_records.folder import SHARED, has_records

QUARTERS = 4
FALSE_ALARM = ("named", "class", "unnamed")

Pair = tuple[str, Model, Dataset, Dataset]


def pairs(folder: Path) -> Iterator[Pair]:
    """Each pair in words, with its model, its reference and the record that is asked about."""
    drives = electric_drives.records(folder)
    for i, old in enumerate(drives):
        new = drives[(i + 1) % len(drives)]
        yield f"drives {old.name} -> {new.name}", electric_drives.make_model(), old, new
    whole = heat_exchanger.record(folder).rows(heat_exchanger.FIRST, None)
    yield from _neighbours("heat exchanger", heat_exchanger.make_model(), whole, QUARTERS)
    yield from _neighbours("lamp", lamp.make_model(), lamp.record(folder), 2)
    clean = air_handling_unit.days(folder)[air_handling_unit.REFERENCE]
    yield from _neighbours("air handling, clean day", air_handling_unit.make_model(), clean, 2)
    old, new = cascaded_tanks.read_benchmark(folder / "cascaded-tanks" / "dataBenchmark.csv")
    yield "tanks, estimation -> validation", cascaded_tanks.make_model(), old, new
    yield "tanks, validation -> estimation", cascaded_tanks.make_model(), new, old


def _neighbours(name: str, model: Model, record: Dataset, count: int) -> Iterator[Pair]:
    """Each part of a record with the one before as its reference, and the first with the last."""
    edges = [round(k * len(record) / count) for k in range(count + 1)]
    parts = [record.rows(a, b) for a, b in itertools.pairwise(edges)]
    for i in range(count):
        j = (i + 1) % count
        yield f"{name}, part {i + 1} -> {j + 1} of {count}", model, parts[i], parts[j]


def main(folder: Path) -> int:
    """Print a table of every pair with its verdict; 2 where there is nothing to judge."""
    if not has_records(folder):
        return 2
    console, alarms, count = Console(), 0, 0
    table = Table("reference -> record", "verdict", "seconds", "what was told")
    for name, model, old, new in pairs(folder):
        began = time.perf_counter()
        verdict = find_changes(model, [new], [old], processes=available_processes()).verdict
        alarm = verdict.word in FALSE_ALARM
        alarms, count = alarms + alarm, count + 1
        word = f"{verdict.word} (false alarm)" if alarm else verdict.word
        table.add_row(name, word, f"{time.perf_counter() - began:.0f}", verdict.reason)
        console.print(f"{name}: {word}", soft_wrap=True)
    console.print(table)
    console.print(f"False alarms: {alarms} of {count}.")
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else SHARED))
