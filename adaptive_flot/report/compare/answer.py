"""The answer of a comparison: who earns or fits most, what it costs in limits, and who decided."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.report.compare.contenders import colour_names
from adaptive_flot.report.compare.findings import OFTEN, findings
from adaptive_flot.report.kit.parts import Fact, Table
from adaptive_flot.report.kit.wording import joined, number, spaced
from adaptive_flot.runner.commands.comparison import ORACLE, Comparison, Contender, SeedSpread

VALUE = "value_cu_h"


def is_earned(comparison: Comparison) -> bool:
    """Whether the scenario has economics."""
    return any(c.has(VALUE) for c in comparison.contenders)


def outcome(comparison: Comparison, contender: Contender) -> FloatArray:
    """What counts, a value a seed (S,): value [cu/h], or the mean of all fits [%]."""
    if is_earned(comparison):
        return contender.values(VALUE)
    names = fit_names(comparison)
    return np.mean([contender.values(n) for n in names], axis=0) if names else np.full(len(contender.seeds), np.nan)


def best(comparison: Comparison) -> Contender | None:
    """The contender that earns most within the limit, without economics that fits best; the oracle is none."""
    real = [c for c in comparison.contenders if c.estimator != ORACLE]
    if any(c.has(VALUE) for c in real):
        within = [c for c in real if c.has(VALUE) and c.spread("below_limit").median <= OFTEN]
        return max(within, key=lambda c: c.spread(VALUE).median, default=None)
    names = fit_names(comparison)
    fitting = [c for c in real if names and all(np.isfinite(c.spread(n).median) for n in names)]
    return max(fitting, key=lambda c: sum(c.spread(n).median for n in names), default=None)


def fit_names(comparison: Comparison) -> list[str]:
    """Columns of fits that any contender has."""
    found = dict.fromkeys(m for c in comparison.contenders for m in c.metrics)
    return [m for m in found if m.startswith("fit_")]


def title(comparison: Comparison) -> str:
    """Who is best, in a few words."""
    winner = best(comparison)
    earned = any(c.has(VALUE) for c in comparison.contenders)
    if winner is not None and earned and len(tied := _tied(comparison, winner)) > 1:
        return f"{joined(short(comparison, c) for c in tied)} earn the same"
    if winner is None:
        return "Nobody keeps the grade limit" if earned else "No fit to compare"
    if len([c for c in comparison.contenders if c.estimator != ORACLE]) == 1:
        value = winner.spread(VALUE if earned else fit_names(comparison)[0]).median
        return f"{winner.label}: {number(value, '.3f')} cu/h" if earned else f"{winner.label}: fit {number(value)} %"
    name = short(comparison, winner)
    return f"{name} earns most within the limit" if earned else f"{name} fits best"


def short(comparison: Comparison, c: Contender) -> str:
    """Name of a contender in a sentence: its controller is left out where all have the same."""
    same = len({x.controller for x in comparison.contenders}) == 1 and not c.result
    return c.estimator if same else c.label.replace(", ", " with ", 1)


def _tied(comparison: Comparison, winner: Contender) -> list[Contender]:
    """Contenders whose value shows the same three decimals as the best one's, and that keep the limit."""
    most = round(winner.spread(VALUE).median, 3)
    return [c for c in comparison.contenders if round(_judged(c, VALUE), 3) == most]


def sentences(comparison: Comparison) -> list[str]:
    """What the numbers say, the best one first."""
    said = findings(comparison)
    winner, names = best(comparison), fit_names(comparison)
    if winner is not None and not winner.has(VALUE):
        fits = ", ".join(f"{_fit_name(n)} {number(winner.spread(n).median)} %" for n in names)
        said.insert(0, f"Best fits together: {winner.label}: {fits}.")
    return said


def facts(comparison: Comparison) -> list[Fact]:
    """Money, recovery, limit and who decided, of the best one."""
    c = best(comparison)
    if c is None or not c.has(VALUE):
        return _fit_facts(comparison, c)
    below, share = 100 * c.spread("below_limit").median, comparison.share(c, VALUE)
    gained = SeedSpread.of(share)
    note = f"{number(100 * gained.median, '.1f')} % of the oracle's gain" if np.isfinite(share).any() else c.label
    decided = c.counts("decided")
    own = 100 * decided.get(c.controller, 0) / max(1, sum(decided.values()))
    limit = number(comparison.grade_limit, "g")
    return [
        Fact("Value", f"{number(c.spread(VALUE).median, '.3f')} cu/h", note),
        Fact("Recovery", f"{number(100 * c.spread('recovery').median, '.1f')} %", "of the valuable mass fed"),
        Fact(
            "Below the limit",
            f"{number(below, '.1f')} %",
            f"of the time; grade {limit}",
            "bad" if below > 1 else "good",
        ),
        Fact("Decided by", f"{own:.1f} %", f"its controller, {spaced(c.controller)}", "good" if own > 99 else "bad"),
    ]


def _fit_facts(comparison: Comparison, c: Contender | None) -> list[Fact]:
    if c is None:
        return []
    return [
        Fact(f"Fit of {_fit_name(n)}", f"{number(c.spread(n).median)} %", c.label) for n in fit_names(comparison)[:5]
    ]


def matrix(comparison: Comparison) -> Table | None:
    """Contender by outcome, medians only, the best of each column marked; the oracle is shown but never marked."""
    columns: Sequence[tuple[str, str, str, float, int]] = (
        ("Value [cu/h]", VALUE, ".3f", 1.0, 1),
        ("Recovery [%]", "recovery", ".1f", 100.0, 1),
        ("Mean grade", "mean_grade", ".4f", 1.0, 0),
        ("Below limit [% of time]", "below_limit", ".1f", 100.0, -1),
    )
    if not any(c.has(VALUE) for c in comparison.contenders):
        columns = [(f"{_fit_name(n)} [%]", n, ".2f", 1.0, 1) for n in fit_names(comparison)]
    if not columns:
        return None
    rows, everyone = [], comparison.contenders
    with_decided = any(c.counts("decided") for c in everyone)
    for c in everyone:
        cells = (number(factor * c.spread(name).median, form) for _, name, form, factor, _ in columns)
        rows.append((c.label, *cells, *([_deciders(c)] if with_decided else [])))
    header = ("Contender", *(heading for heading, *_ in columns), *(["Decided by"] if with_decided else []))
    caption = "Medians over the seeds. ★: the best" + (
        " of those that keep the limit; the oracle knows the true parameters and is no contender."
        if any(c.estimator == ORACLE for c in everyone)
        else "."
    )
    table = Table(caption, header, tuple(rows), colours=colour_names(comparison))
    for j, (_, name, form, factor, sign) in enumerate(columns, 1):
        medians = np.array([_judged(c, name) for c in everyone])
        if sign:
            table = table.with_best(j, np.round(factor * medians, int(form[1])), least=sign < 0)
    return table


def is_out(c: Contender) -> bool:
    """Whether it can not be the best: it is the oracle, or below the limit too often."""
    return c.estimator == ORACLE or (c.has("below_limit") and c.spread("below_limit").median > OFTEN)


def _judged(c: Contender, name: str) -> float:
    return float("nan") if is_out(c) else c.spread(name).median


def _deciders(c: Contender) -> str:
    counts = c.counts("decided")
    total = max(1, sum(counts.values()))
    shown = [f"{spaced(name)} {100 * n / total:.1f} %" for name, n in counts.items() if n / total >= 0.0005]
    return ", ".join(shown) or "–"


def _fit_name(column: str) -> str:
    return spaced(column.removeprefix("fit_"))
