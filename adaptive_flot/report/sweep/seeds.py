"""Seeds of a study worth a look: those that failed, and those that did worst."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from adaptive_flot.report.compare import answer as compared
from adaptive_flot.report.kit.parts import Table
from adaptive_flot.report.kit.wording import number, spaced
from adaptive_flot.runner.commands.comparison import Comparison, Contender

SHOWN = 3
"""Worst seeds of each contender."""
MOST_NAMED = 8
"""Seeds that a row of failures names."""


@dataclass(frozen=True)
class Failed:
    """Runs of a study that failed, as rows of its table."""

    rows: pd.DataFrame
    runs: int

    @classmethod
    def of(cls, table: pd.DataFrame) -> Failed:
        """Those of a table of runs."""
        return cls(table[table["outcome"] == "failed"], len(table))

    @property
    def count(self) -> int:
        """How many."""
        return len(self.rows)

    @property
    def sentence(self) -> str:
        """How many, and the most frequent reason."""
        message, often = next(iter(self.rows["message"].value_counts().items()))
        return f"{self.count} of {self.runs} runs failed, {often} of them with: {message}"

    def table(self) -> Table | None:
        """Reasons, with who and which seeds; None where nothing failed."""
        if not self.count:
            return None
        keys = ["message", "scenario", "controller", "estimator"]
        rows = []
        for (message, *who), part in self.rows.groupby(keys, sort=False):
            seeds = [str(seed) for seed in part["seed"]]
            more = f" and {len(seeds) - MOST_NAMED} more" if len(seeds) > MOST_NAMED else ""
            rows.append((*map(str, who), str(len(part)), ", ".join(seeds[:MOST_NAMED]) + more, str(message)))
        caption = "Runs that failed; --retry-failed runs them again."
        header = ("Scenario", "Controller", "Estimator", "Runs", "Seeds", "Message")
        return Table(caption, header, tuple(rows), words=len(header))


def worst_table(comparison: Comparison) -> Table | None:
    """The seeds with the lowest first fit (with economics: value) of each contender, and how to see one."""
    names = compared.fit_names(comparison)
    earned = any(c.has(compared.VALUE) for c in comparison.contenders)
    columns = [compared.VALUE, "recovery", "below_limit"] if earned else names
    if not columns or max(len(c.seeds) for c in comparison.contenders) <= SHOWN:
        return None
    rows = [row for c in comparison.contenders for row in _worst(c, columns)]
    first = comparison.contenders[0]
    caption = (
        f"{comparison.scenario}: seeds with the lowest {_heading(columns[0])}. To see one: adaptive-flot run "
        f"{comparison.scenario} --controller {first.controller} --estimator {first.estimator} --seed ..."
    )
    return Table(caption, ("Contender", "Seed", *map(_heading, columns)), tuple(rows))


def _worst(c: Contender, columns: Sequence[str]) -> list[tuple[str, ...]]:
    if not c.has(columns[0]):
        return []
    lowest = c.runs[columns[0]].astype(float).nsmallest(SHOWN).index
    return [
        (c.label, str(s), *(number(float(c.runs.loc[s, n]), ".4g") for n in columns if n in c.runs)) for s in lowest
    ]


def _heading(column: str) -> str:
    if column == compared.VALUE:
        return "value [cu/h]"
    fit = column.startswith("fit_")
    return f"fit of {spaced(column.removeprefix('fit_'))} [%]" if fit else f"{spaced(column)} [–]"
