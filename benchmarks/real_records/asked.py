"""The figures that were asked of discovery, each with its target and what was measured.

Those of measured records come from the verdicts of this run. Those of simulated records take hours: they come from
the verdicts that are published beside each benchmark, and the table says of which commit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from rich.table import Table

from adaptive_flot.discovery.results import Verdict
from benchmarks.hidden_effects.score.summary import Rate, rates
from benchmarks.plant_like.score import figures

BENCHMARKS = Path(__file__).parents[1]
SIMULATED = BENCHMARKS / "hidden_effects" / "published" / "discover_2f630032.csv"
PAIRS = SIMULATED.with_name("discover_62d3a7d0_pairs.csv")
"""The pairs of the 300 alone, by a later commit."""
PLANT_LIKE = BENCHMARKS / "plant_like" / "published" / "discover_23226a9_seed_2083.csv"
"""The last tables of all records that one commit has judged, `discover_COMMIT[_seed_SEED].csv`."""
OF_THE_300 = {
    "truth named or in a class of 3, single ordinary": "the 300: told",
    "wrong name, of records with an effect": "the 300: wrong names",
    "pairs: both named, or in a class of three names each": "pairs of the 300: both told",
    "pairs: one effect told at least": "pairs of the 300: what is certain",
}
"""Rates of the 300 that were asked for, by their name there."""
NAMED = {"electric drives, 5 records": "drives: absolute value", "heat exchanger": "heat exchanger: effect"}
"""Records whose effect is to be named."""
ERRORS = {"heat exchanger": ("K", "< 0.552", 0.552), "cascaded tanks": ("V", "<= 0.20", 0.20)}
"""Records with an error that was asked for: its unit, the target in words, and the largest error."""


@dataclass(frozen=True)
class Judged:
    """A verdict beside the truth, and what it is worth.

    Attributes
    ----------
    record, truth
        Name of the record, and what is true of it in words.
    verdict
        What was told.
    worth
        `right`, `wrong`, `wide` where the right part is one of more than two, or `open` where nothing is told.
    error
        Root mean square error of the free run on rows that no fit has seen, where such a figure is asked for.
    """

    record: str
    truth: str
    verdict: Verdict
    worth: str
    error: float | None = None


@dataclass(frozen=True)
class Asked:
    """A figure: what was asked, what was measured, whether that meets it, and where it comes from."""

    figure: str
    target: str
    measured: str
    met: bool
    by: str = "this run"


def of_measured_records(judged: Sequence[Judged], shows: Sequence[str]) -> list[Asked]:
    """Figures of the verdicts of this run; a group that was not judged has none.

    Parameters
    ----------
    judged
        All verdicts.
    shows
        Names of the air-handling days whose fault shows.
    """
    by_name = {j.record: j for j in judged}
    wrong = sum(j.worth == "wrong" for j in judged)
    asked = [Asked("wrong names, measured records", "0", f"{wrong} of {len(judged)}", wrong == 0)]
    days = [by_name[name] for name in shows if name in by_name]
    if days:
        right = sum(j.worth == "right" for j in days)
        share = f"{right} of {len(days)}"
        asked.append(Asked("air handling: right part, or a class of two", ">= 80 %", share, right >= 0.8 * len(days)))
    for name, figure in NAMED.items():
        if name in by_name:
            asked.append(Asked(figure, "named", by_name[name].verdict.word, by_name[name].worth == "right"))
    for name, (unit, target, most) in ERRORS.items():
        error = by_name[name].error if name in by_name else None
        if error is not None:
            asked.append(Asked(f"{name}: error run on", f"{target} {unit}", f"{error:.3f} {unit}", error <= most))
    for name, word in (("lamp", "not named"), ("cascaded tanks", "every part named")):
        if name in by_name:
            said = by_name[name].verdict.word
            asked.append(Asked(f"{name}: verdict", word, said, (said == "named") == (word != "not named")))
    return [*asked, _times([j.verdict.seconds for j in judged], "measured records")]


def of_simulated_records() -> list[Asked]:
    """Figures of the published verdicts on the 300 and on plant-like records.

    Raises
    ------
    FileNotFoundError
        A published table is missing.
    """
    asked = [_asked(OF_THE_300[r.what], r, SIMULATED) for r in rates(pd.read_csv(SIMULATED)) if r.what in OF_THE_300]
    again = {r.what: r for r in rates(pd.read_csv(PAIRS))}
    asked += [_asked(f"{name}, again", again[what], PAIRS) for what, name in OF_THE_300.items() if "pairs" in what]
    table = pd.read_csv(PLANT_LIKE, keep_default_na=False)
    for row in figures(table).itertuples():
        share = float(str(row.share).split()[0])
        measured = f"{row.share} ({str(row.count).replace(' of ', '/')})"
        if row.figure == "told, records with an effect":
            asked.append(Asked("plant-like: told", ">= 75 %", measured, share >= 75, _by(PLANT_LIKE)))
        elif row.figure == "wrong name, all records":
            asked.append(Asked("plant-like: wrong names", "<= 3 %", measured, share <= 3, _by(PLANT_LIKE)))
    return [*asked, _times(table.seconds, "plant-like", _by(PLANT_LIKE))]


def table_of(asked: Sequence[Asked]) -> Table:
    """The table to print."""
    table = Table(title="Figures asked for, and measured", title_justify="left")
    for heading in ("figure", "target", "measured", "met", "by"):
        table.add_column(heading)
    for a in asked:
        table.add_row(a.figure, a.target, a.measured, "yes" if a.met else "no", a.by)
    return table


def _asked(figure: str, rate: Rate, table: Path) -> Asked:
    bound = float(rate.asked.split()[1]) / 100
    met = rate.share <= bound if rate.asked.startswith("<") else rate.share >= bound
    return Asked(figure, rate.asked, str(rate), met, _by(table))


def _by(table: Path) -> str:
    """The commit in the name of a published table."""
    return f"{table.stem.split('_')[1]}, published"


def _times(seconds: Sequence[float] | pd.Series, of: str, by: str = "this run") -> Asked:
    """Times of verdicts against what was asked for them, machine as it was."""
    middle, most = np.quantile(np.asarray(seconds, dtype=np.float64), [0.5, 0.95])
    met = bool(middle <= 30 and most <= 60)
    return Asked(f"{of}: seconds, median and 95 %", "<= 30, <= 60", f"{middle:.0f}, {most:.0f}", met, by)
