"""What a sweep shows while it runs: a bar with live counts of statuses."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

PLAIN_EVERY_S = 30.0
"""Time between two lines where standard error is no terminal."""
QUIET = ("ok", "initialising")
"""Statuses of the estimator that are not worth a count."""

Rows = Sequence[Mapping[str, Any]]


class Counts:
    """Runs by outcome, and samples by status of the estimator."""

    def __init__(self) -> None:
        self.outcomes: Counter[str] = Counter()
        self.statuses: Counter[str] = Counter()

    def add(self, rows: Rows) -> None:
        """Count rows of the table of runs."""
        for row in rows:
            self.outcomes[row["outcome"]] += 1
            for key, value in row.items():
                if key.startswith("status_") and value == value and key.removeprefix("status_") not in QUIET:
                    self.statuses[key.removeprefix("status_")] += int(value)

    def text(self) -> str:
        """`412 ok, 1 failed; samples: 33 projected, 2 missing`."""
        runs = ", ".join(f"{self.outcomes[o]} {o}" for o in ("ok", "failed") if self.outcomes[o] or o == "ok")
        samples = ", ".join(f"{n} {status}" for status, n in self.statuses.most_common() if n)
        return runs + (f"; samples: {samples}" if samples else "")


@contextmanager
def live(label: str) -> Iterator[Callable[[int, Rows], Callable[[Rows], None]]]:
    """Yield the `progress` of a sweep: a bar on standard error, or a line now and then where that is no terminal."""
    console, counts = Console(stderr=True, markup=False), Counts()
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[counts]}", markup=False),
    )
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:

        def start(total: int, before: Rows) -> Callable[[Rows], None]:
            counts.add(before)
            task = bar.add_task(label, total=total, completed=len(before), counts=counts.text())
            if before:
                console.print(f"{label}: {len(before)} of {total} runs are there, going on", highlight=False)
            said = time.monotonic()

            def advance(rows: Rows) -> None:
                nonlocal said
                counts.add(rows)
                bar.update(task, advance=len(rows), counts=counts.text())
                if not console.is_terminal and time.monotonic() - said > PLAIN_EVERY_S:
                    said = time.monotonic()
                    console.print(f"{label}: {sum(counts.outcomes.values())} of {total}: {counts.text()}")

            return advance

        yield start
