"""Differences between contenders, paired by seed: noise that all of a seed share cancels."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.report.compare.answer import VALUE, best, fit_names
from adaptive_flot.report.kit.parts import Table
from adaptive_flot.report.kit.wording import number, spaced
from adaptive_flot.runner.commands.comparison import Comparison, Contender

LEVEL = 0.95


def paired_table(comparison: Comparison) -> Table | None:
    """The best contender against each other one, seed by seed: mean difference, interval, wins; None with one only.

    The interval is that of Student's t for the mean of paired differences, so that it needs two seeds.
    """
    winner = best(comparison)
    others = [c for c in comparison.contenders if c is not winner]
    if winner is None or not others:
        return None
    names = [(VALUE, "value [cu/h]", ".3f")] if winner.has(VALUE) else []
    names = names or [(n, f"{spaced(n.removeprefix('fit_'))} [%]", ".2f") for n in fit_names(comparison)]
    rows = []
    for name, heading, form in names:
        for other in others:
            d = differences(winner, other, name)
            if d.size:
                rows.append((other.label, heading, *_cells(d, form)))
    if not rows:
        return None
    caption = (
        f"{comparison.scenario}: {winner.label} minus each other one, paired by seed. Interval: 95 % of the mean "
        "difference (Student's t). Wins: seeds in which it is ahead."
    )
    header = ("Against", "Of", "Seeds", "Mean difference", "95 % interval", "Wins")
    return Table(caption, header, tuple(rows), words=2)


def differences(one: Contender, other: Contender, column: str) -> FloatArray:
    """Values of one minus those of the other in each seed that both ran (S,)."""
    if not (one.has(column) and other.has(column)):
        return np.empty(0)
    both = pd.concat([one.runs[column].astype(float), other.runs[column].astype(float)], axis=1, join="inner").dropna()
    found: FloatArray = (both.iloc[:, 0] - both.iloc[:, 1]).to_numpy()
    return found


def interval(d: FloatArray) -> tuple[float, float]:
    """95 % interval of the mean of differences (S,); NaN with fewer than two."""
    if d.size < 2:
        return float("nan"), float("nan")
    half = float(stdtrit(d.size - 1, 0.5 + LEVEL / 2)) * float(np.std(d, ddof=1)) / float(np.sqrt(d.size))
    return float(d.mean()) - half, float(d.mean()) + half


def _cells(d: FloatArray, form: str) -> tuple[str, str, str, str]:
    low, high = interval(d)
    span = "–" if np.isnan(low) else f"{number(low, f'+{form}')} to {number(high, f'+{form}')}"
    return str(d.size), number(float(d.mean()), f"+{form}"), span, f"{int((d > 0).sum())} of {d.size}"
