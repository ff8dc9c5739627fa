"""Tables of a comparison: the same cells for the terminal, the page and Markdown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.report.kit.parts import Table
from adaptive_flot.report.kit.wording import number
from adaptive_flot.runner.commands.comparison import ORACLE, Comparison, Contender, SeedSpread

MANY_SEEDS = 20
"""Seeds from which a distribution is more than its median and range."""
QUANTILES = ((0, "Least"), (0.05, "5 %"), (0.25, "25 %"), (0.5, "Median"), (0.75, "75 %"), (0.95, "95 %"), (1, "Most"))

Values = Callable[[Contender], FloatArray]


@dataclass(frozen=True)
class Column:
    """A column of numbers: heading with unit, values over the seeds, factor to that unit, format."""

    heading: str
    values: Values
    form: str
    factor: float = 1.0


def outcome_table(comparison: Comparison) -> Table | None:
    """Recovery, grade and its limit, value, and share of the oracle's gain; None without economics."""
    columns = [
        _column("Value [cu/h]", "value_cu_h", ".3f"),
        Column("Share of oracle's gain [%]", lambda c: comparison.share(c, "value_cu_h"), ".1f", 100.0),
        _column("Recovery [–]", "recovery", ".4f"),
        _column("Mean grade [–]", "mean_grade", ".4f"),
        _column("Below limit [% of time]", "below_limit", ".1f", 100.0),
        _column("Depth below [–]", "mean_depth", ".4f"),
    ]
    if not any(c.has("value_cu_h") for c in comparison.contenders):
        return None
    caption = (
        f"{comparison.scenario}: economic value in currency units (cu); share of the value that the oracle gains over "
        "fixed parameters with the same controller, paired by seed; recovery (valuable mass recovered over fed); mean "
        f"grade by mass of concentrate; share of time more than 0.002 below the grade limit of "
        f"{comparison.grade_limit:g}, and mean depth in that time. {spread_text(comparison)}"
    )
    return _table(comparison, caption, columns)


def overview_table(comparisons: Sequence[Comparison]) -> Table | None:
    """The outcomes of all scenarios in one table; None unless there are several with economics."""
    parts = [(c, table) for c in comparisons if (table := outcome_table(c)) is not None]
    if len(parts) < 2:
        return None
    header = list(dict.fromkeys(heading for _, table in parts for heading in table.header))
    rows = [
        (comparison.scenario, *(dict(zip(table.header, row, strict=True)).get(heading, "–") for heading in header))
        for comparison, table in parts
        for row in table.rows
    ]
    same = len({spread_text(c) for c, _ in parts}) == 1
    caption = f"All scenarios. {spread_text(parts[0][0]) if same else 'Medians, and ranges, over the seeds of each.'}"
    words = 1 + max(table.words for _, table in parts)
    return Table(caption, ("Scenario", *header), tuple(rows), words)


def value_table(comparison: Comparison) -> Table | None:
    """Economic value by named term; None without economics."""
    terms = [
        name.removeprefix("value_").removesuffix("_cu_h")
        for name in dict.fromkeys(m for c in comparison.contenders for m in c.metrics)
        if name.startswith("value_") and name != "value_cu_h"
    ]
    if not terms:
        return None
    columns = [_column(f"{term.capitalize()} [cu/h]", f"value_{term}_cu_h", ".3f") for term in terms]
    columns.append(_column("Sum [cu/h]", "value_cu_h", ".3f"))
    caption = f"{comparison.scenario}: economic value by term; costs are negative. {spread_text(comparison)}"
    return _table(comparison, caption, columns)


def fits_table(comparison: Comparison) -> Table | None:
    """Fits of parameters and outputs; None if no run has any."""
    names = [m for m in dict.fromkeys(m for c in comparison.contenders for m in c.metrics) if m.startswith("fit_")]
    if not names:
        return None
    columns = [_column(f"{n.removeprefix('fit_').replace('_', ' ')} [%]", n, ".2f") for n in names]
    caption = (
        f"{comparison.scenario}: fit of the estimates in percent, 100 (1 − ‖truth − estimate‖ / ‖truth‖). "
        f"{spread_text(comparison)}"
    )
    table = _table(comparison, caption, columns)
    for name, column in zip(names, columns, strict=True):
        medians = [np.nan if c.estimator == ORACLE else c.spread(name).median for c in comparison.contenders]
        table = table.with_best(table.header.index(column.heading), np.round(medians, 2))
    return table


def status_table(comparison: Comparison) -> Table:
    """Statuses and who decided."""
    words = {
        "Estimates": lambda c: _counts({k: n for k, n in c.counts("status").items() if k != "initialising"}),
        "Decisions": lambda c: _counts(c.counts("control")),
        "Decided by": lambda c: _counts(c.counts("decided"), share=True),
    }
    caption = (
        f"{comparison.scenario}: statuses of estimates and of decisions, all seeds together (a decision is an "
        "optimisation, or another interval that did not go well); who decided, in share of time."
    )
    return _table(comparison, caption, (), words)


def time_table(comparison: Comparison) -> Table | None:
    """Times of solves and runs; None if none was taken."""
    columns = [
        _column("Solves", "solves", ".0f"),
        _column("Solve, median [ms]", "solve_median_s", ".1f", 1e3),
        _column("Solve, p99 [ms]", "solve_p99_s", ".1f", 1e3),
        _column("Run [s]", "seconds", ".1f"),
        _column("Run, processor [s]", "cpu_seconds", ".2f"),
    ]
    caption = (
        f"{comparison.scenario}: wall-clock time of a solve within a run (median and 99th percentile), wall-clock and "
        f"processor time of the run. {spread_text(comparison)}"
    )
    table = _table(comparison, caption, columns)
    return table if len(table.header) > table.words + 1 else None


def quantile_table(comparison: Comparison) -> Table | None:
    """Distribution of each outcome over the seeds; None with too few of them."""
    if max(len(c.seeds) for c in comparison.contenders) < MANY_SEEDS:
        return None
    wanted = {"value_cu_h": ("Value [cu/h]", ".3f"), "recovery": ("Recovery [–]", ".4f")}
    names = [m for m in dict.fromkeys(m for c in comparison.contenders for m in c.metrics)]
    wanted |= {n: (f"Fit of {n.removeprefix('fit_').replace('_', ' ')} [%]", ".2f") for n in names if "fit_" == n[:4]}
    results = any(c.result for c in comparison.contenders)
    rows = []
    for name, (heading, form) in wanted.items():
        for c in (c for c in comparison.contenders if c.has(name)):
            values = c.values(name)
            finite = values[np.isfinite(values)]
            cells = (number(float(v), form) for v in np.quantile(finite, [q for q, _ in QUANTILES]))
            own = (heading, c.controller, c.estimator, *((c.result,) if results else ()))
            rows.append((*own, str(len(finite)), *cells))
    header = ("Quantity", "Controller", "Estimator", *(("Result",) if results else ()))
    caption = f"{comparison.scenario}: distribution over the seeds, by quantiles of the finite values."
    return Table(caption, (*header, "Runs", *(h for _, h in QUANTILES)), tuple(rows), words=len(header))


def made_table(comparison: Comparison) -> Table:
    """What made the runs of each contender: result, version and commit, options that are not at their default."""
    rows = []
    for c in comparison.contenders:
        told = (_distinct(c, "result"), _distinct(c, "code"), _distinct(c, "options"))
        rows.append((c.controller, c.estimator, *told))
    header = ("Controller", "Estimator", "Result", "adaptive-flot", "Options")
    caption = f"{comparison.scenario}: where the runs lie, and what made them."
    return Table(caption, header, tuple(rows), words=len(header))


def _distinct(contender: Contender, column: str) -> str:
    """Words of a column over the seeds, each once; a dash where the result does not say."""
    if column not in contender.runs:
        return "–"
    words = dict.fromkeys(str(word) for word in contender.runs[column].dropna() if str(word))
    return "\n".join(words) or "–"


def spread_text(comparison: Comparison) -> str:
    """Say what a cell holds."""
    if max(len(c.seeds) for c in comparison.contenders) == 1:
        return "One seed."
    text = "Median over the seeds, and range where the digits shown differ."
    return text if comparison.same_seeds else f"{text} Not all ran the same seeds."


def compare_tables(comparison: Comparison) -> list[Table]:
    """All tables of a comparison that hold something, those with the answer first."""
    makers = (outcome_table, value_table, fits_table, status_table, time_table, quantile_table)
    return [table for make in makers if (table := make(comparison)) is not None]


def markdown(table: Table) -> str:
    """A table in Markdown, caption first."""

    def line(cells: Sequence[str]) -> str:
        return "| " + " | ".join(flat(j, *cell.replace("|", "\\|").split("\n")) for j, cell in enumerate(cells)) + " |"

    def flat(j: int, first: str, *more: str) -> str:
        return ", ".join((first, *more)) if j < table.words or not more else f"{first} [{', '.join(more)}]"

    rule = "|" + "|".join("---" if j < table.words else "---:" for j in range(len(table.header))) + "|"
    return "\n".join([table.caption, "", line(table.header), rule, *map(line, table.rows), ""])


def _column(heading: str, name: str, form: str, factor: float = 1.0) -> Column:
    return Column(heading, lambda c: c.values(name), form, factor)


def _table(
    comparison: Comparison,
    caption: str,
    columns: Sequence[Column],
    words: dict[str, Callable[[Contender], str]] | None = None,
) -> Table:
    """Names on the left, then words, seeds and the columns in which anyone has a number."""
    words = words or {}
    shown = [c for c in columns if any(np.isfinite(c.values(x)).any() for x in comparison.contenders)]
    results = any(c.result for c in comparison.contenders)
    names = ("Controller", "Estimator", *(("Result",) if results else ()), *words)
    rows = []
    for contender in comparison.contenders:
        own = (contender.controller, contender.estimator, *((contender.result,) if results else ()))
        cells = (cell(column, contender) for column in shown)
        rows.append((*own, *(tell(contender) for tell in words.values()), str(len(contender.seeds)), *cells))
    header = (*names, "Seeds", *(c.heading for c in shown))
    return Table(caption, header, tuple(rows), words=len(names))


def cell(column: Column, contender: Contender) -> str:
    r"""Median, and on a second line the range where the digits shown differ.

    >>> from types import SimpleNamespace
    >>> cell(Column("x", lambda c: np.array([0.1, 0.2, 0.4]), ".1f"), SimpleNamespace(seeds=[1, 2, 3]))
    '0.2\n0.1 – 0.4'
    """
    spread = SeedSpread.of(column.values(contender) * column.factor)
    text, low, high = (number(v, column.form) for v in (spread.median, spread.low, spread.high))
    if low != high:
        text += f"\n{low} – {high}"
    lost = spread.not_finite if np.isfinite(spread.median) else 0
    return text + (f"\n{lost} not finite" if lost else "")


def _counts(counts: dict[str, int], share: bool = False) -> str:
    """Counts by name, largest first, one a line: "ok 328"; as shares with `share`."""
    if not counts:
        return "–"
    total = sum(counts.values())
    if share:
        parts = ((name, 100 * n / total) for name, n in counts.items())
        return "\n".join(f"{name} {'< 0.1' if part < 0.05 else f'{part:.1f}'} %" for name, part in parts)
    return "\n".join(f"{name.replace('_', ' ')} {n:,}".replace(",", "\u00a0") for name, n in counts.items())
