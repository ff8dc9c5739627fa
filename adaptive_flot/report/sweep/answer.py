"""The answer of a study: who is best in which scenario, how surely, and what failed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.report.compare import answer as compared
from adaptive_flot.report.compare.answer import is_earned, outcome
from adaptive_flot.report.kit.parts import Fact, Table
from adaptive_flot.report.kit.wording import number, spaced
from adaptive_flot.report.sweep.seeds import Failed
from adaptive_flot.runner.commands.comparison import ORACLE, Comparison, Contender

FEWEST_FOR_SHARES = 10
"""Seeds from which nine in ten mean something."""


def title(comparisons: Sequence[Comparison]) -> str:
    """Who is best, in a few words."""
    if len(comparisons) == 1:
        return compared.title(comparisons[0])
    winners = [compared.short(c, w) for c in comparisons if (w := compared.best(c)) is not None]
    if not winners:
        return "No contender stands out in any scenario"
    first = max(dict.fromkeys(winners), key=winners.count)
    return f"{first} is best in {winners.count(first)} of {len(comparisons)} scenarios"


def sentences(comparisons: Sequence[Comparison], failed: Failed) -> list[str]:
    """What failed, then what the numbers of each scenario say, and how surely."""
    said = [failed.sentence] if failed.count else []
    for comparison in comparisons:
        where = f"{comparison.scenario}: " if len(comparisons) > 1 else ""
        said += [f"{where}{text}" for text in (*compared.sentences(comparison), *_surely(comparison))]
    return said


def _surely(comparison: Comparison) -> list[str]:
    """Over how many seeds the best one keeps its lead, and what nine in ten seeds reach."""
    winner = compared.best(comparison)
    if winner is None:
        return []
    name = compared.short(comparison, winner)
    own, what = outcome(comparison, winner), "cu/h" if is_earned(comparison) else "% (mean of all fits)"
    said = []
    known = own[np.isfinite(own)]
    if known.size >= FEWEST_FOR_SHARES:
        low, middle = np.quantile(known, (0.1, 0.5))
        said.append(
            f"Of the seeds, half come to {number(middle)} {what} and more with {name}, nine in ten to "
            f"{number(low)} and more."
        )
    for rival in _rivals(comparison, winner):
        one, other = _paired(comparison, winner, rival)
        if one.size >= 2:
            wins = int((one > other).sum())
            next_best = compared.short(comparison, rival)
            said.append(f"{name} is ahead of the next best, {next_best}, with {wins} of {one.size} seeds.")
    return said


def _rivals(comparison: Comparison, winner: Contender) -> list[Contender]:
    """The next best one, if any; the oracle is no contender."""
    others = [c for c in comparison.contenders if c is not winner and c.estimator != ORACLE]
    known = {c.label: m for c in others if np.isfinite(m := _median(outcome(comparison, c)))}
    return [max((c for c in others if c.label in known), key=lambda c: known[c.label])] if known else []


def _paired(comparison: Comparison, one: Contender, other: Contender) -> tuple[FloatArray, FloatArray]:
    """Outcomes of the seeds that both ran."""
    a, b = (dict(zip(c.seeds, outcome(comparison, c).tolist(), strict=True)) for c in (one, other))
    both = [s for s in a if s in b and np.isfinite(a[s]) and np.isfinite(b[s])]
    return np.array([a[s] for s in both]), np.array([b[s] for s in both])


def _median(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else float("nan")


def facts(comparisons: Sequence[Comparison], runs: int, failed: Failed) -> list[Fact]:
    """How many runs, and the numbers of the best one."""
    note, tone = (f"{failed.count} failed", "bad") if failed.count else ("none failed", "good")
    own = compared.facts(comparisons[0]) if len(comparisons) == 1 else []
    return [Fact("Runs", str(runs), note, tone), *own[:4]]


def overview(comparisons: Sequence[Comparison]) -> Table:
    """Contender by scenario: what counts, in the median over the seeds, the best of each scenario marked."""
    labels = list(dict.fromkeys(c.label for x in comparisons for c in x.contenders))
    medians = np.array([[_of(x, label) for x in comparisons] for label in labels])
    rows = tuple((label, *(number(m) for m in row)) for label, row in zip(labels, medians, strict=True))
    units = dict.fromkeys("value [cu/h]" if is_earned(c) else "mean of all fits [%]" for c in comparisons)
    caption = f"Medians over the seeds: {', or '.join(units)}. ★: the best of a scenario; the oracle is no contender."
    table = Table(caption, ("Contender", *(spaced(c.scenario) for c in comparisons)), rows)
    judged = np.array([[_judged(x, label) for x in comparisons] for label in labels])
    for j in range(len(comparisons)):
        table = table.with_best(j + 1, np.round(judged[:, j], 2))
    return table


def _of(comparison: Comparison, label: str) -> float:
    return next((_median(outcome(comparison, c)) for c in comparison.contenders if c.label == label), float("nan"))


def _judged(comparison: Comparison, label: str) -> float:
    """The same, NaN for who is no contender: the oracle, and who breaks the limit."""
    return next(
        (
            float("nan") if compared.is_out(c) else _median(outcome(comparison, c))
            for c in comparison.contenders
            if c.label == label
        ),
        float("nan"),
    )
