"""Print a run, or several side by side."""

from __future__ import annotations

import pandas as pd
from rich.console import Console
from rich.table import Table

from benchmarks.hidden_effects.score.summary import confusion, mistaken, rates, removal, times

_REMOVED = "held-out error removed, share of an oracle's"
_MISTAKES = 15


def _console() -> Console:
    return Console(width=None if Console().is_terminal else 150)


def print_run(label: str, table: pd.DataFrame) -> None:
    """Rates, confusion matrix, what was mistaken for what, time."""
    console = _console()
    figures = Table("figure", "measured, 95 % interval", "asked", title=f"{label}: {len(table)} records")
    for r in rates(table):
        figures.add_row(r.what, str(r), r.asked)
    shares = removal(table)
    for part, asked in (("all", ">= 80 %"), ("found", "")):
        value = f"median {100 * shares[f'{part}_median']:.1f} %, mean {100 * shares[f'{part}_mean']:.1f} %"
        figures.add_row(f"{_REMOVED}: {part}", f"{value} ({shares[f'{part}_count']:.0f} records)", asked)
    t = times(table)
    seconds = f"median {t['median']:.1f}, 90 % below {t['p90']:.1f}, largest {t['largest']:.1f}"
    figures.add_row("seconds a record", seconds, "<= 60 (3000 samples)")
    console.print(figures)
    counts = confusion(table)
    matrix = Table("hidden", *map(str, counts.columns), title="Outcomes")
    for name, row in counts.iterrows():
        matrix.add_row(str(name), *(str(int(n)) if n else "." for n in row))
    console.print(matrix)
    wrong = mistaken(table)
    if len(wrong):
        listing = Table("category", "truth", "said", "count", title=f"Mistakes (first {_MISTAKES})")
        for _, row in wrong.head(_MISTAKES).iterrows():
            listing.add_row(*(str(row[c]) for c in ("category", "truth", "said", "count")))
        console.print(listing)


def print_side_by_side(runs: dict[str, pd.DataFrame]) -> None:
    """The headline figures of several runs on the same records."""
    console = _console()
    figures = Table("figure", *runs, "asked", title="Side by side")
    all_rates = {label: rates(table) for label, table in runs.items()}
    first = next(iter(all_rates.values()))
    for k, r in enumerate(first):
        cells = [
            f"{100 * row[k].share:.0f} % [{100 * row[k].low:.0f}, {100 * row[k].high:.0f}]" if row[k].count else "-"
            for row in all_rates.values()
        ]
        figures.add_row(r.what, *cells, r.asked)
    shares = [f"{100 * removal(t)['all_median']:.0f} %" for t in runs.values()]
    figures.add_row(f"{_REMOVED}: median of all", *shares, ">= 80 %")
    figures.add_row("seconds a record, median", *(f"{times(t)['median']:.1f}" for t in runs.values()), "<= 60")
    console.print(figures)
