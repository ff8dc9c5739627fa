"""Rates with intervals from the rows of a run."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pandas as pd
from statsmodels.stats.proportion import proportion_confint

from benchmarks.hidden_effects.score.outcome import OUTCOMES

FOUND = ("right", "right_class")
ABSTAINED = ("abstained",)


@dataclass(frozen=True)
class Rate:
    """A share of records with its 95 % interval (Clopper-Pearson), and what is asked of it."""

    what: str
    hits: int
    count: int
    low: float
    high: float
    asked: str = ""

    @property
    def share(self) -> float:
        """Hits over count; NaN of nothing."""
        return self.hits / self.count if self.count else float("nan")

    def __str__(self) -> str:
        if not self.count:
            return "no record"
        return f"{100 * self.share:.1f} % [{100 * self.low:.1f}, {100 * self.high:.1f}] ({self.hits}/{self.count})"


def rate(what: str, hit: pd.Series, asked: str = "") -> Rate:
    """Rate of a series of booleans."""
    hits, count = int(hit.sum()), len(hit)
    low, high = proportion_confint(hits, count, method="beta") if count else (0.0, 1.0)
    return Rate(what, hits, count, float(low), float(high), asked)


def rates(table: pd.DataFrame) -> list[Rate]:
    """The figures that are asked for, then those that explain them."""
    outcome, category = table["outcome"], table["category"]
    hidden = category.isin(["single", "pair", "beyond"])
    controls = category.isin(["none", "drift"])
    ordinary = (category == "single") & table["ordinary"]
    named = table["verdict"] == "named"
    wrong = outcome == "wrong_name"
    alarm = outcome == "false_alarm"
    told, word = (table[c][category == "pair"] for c in ("effects_told", "verdict"))
    return [
        rate("wrong name, of records with an effect", wrong[hidden], "<= 2.4 %"),
        rate("false alarm, of controls (none, drift)", alarm[controls], "<= 5 %"),
        rate("truth named or in a class of 3, single ordinary", outcome.isin(FOUND)[ordinary], ">= 90 %"),
        rate("wrong name or false alarm, of all records", wrong | alarm),
        rate("wrong, of all names given", (wrong | alarm)[named]),
        rate("wrong name or wrong class, of records with an effect", (wrong | (outcome == "wrong_class"))[hidden]),
        rate("truth named, single ordinary", (outcome == "right")[ordinary]),
        rate("false alarm: nothing hidden", alarm[category == "none"]),
        rate("false alarm: drift of n, C", alarm[category == "drift"]),
        rate("drift of n, C called coalescence or growth exponent", (outcome == "tolerated")[category == "drift"]),
        rate("pairs: both named, or in a class of three names each", (told == 2) & (word != "unnamed"), ">= 50 %"),
        rate("pairs: both named", (outcome == "right")[category == "pair"]),
        rate("pairs: one effect told at least", told > 0, ">= 80 %"),
        rate("pairs: wrong name", wrong[category == "pair"]),
        rate("out of catalogue: wrong name", wrong[category == "beyond"]),
        rate("unexcited: wrong name or false alarm", (wrong | alarm)[category == "unexcited"]),
        rate("faulty data: false alarm", alarm[category == "fault"]),
        rate("missed, single ordinary", (outcome == "missed")[ordinary]),
        rate("abstained, of all", outcome.isin(ABSTAINED)),
        rate("failed or out of time, of all", outcome.isin(["failed", "timeout"])),
    ]


def removal(table: pd.DataFrame) -> dict[str, float]:
    """Held-out error removed as a share of an oracle's: single ordinary records, all and only those found."""
    single = table[(table["category"] == "single") & table["ordinary"] & table["removed_share"].notna()]
    hits = single[single["outcome"].isin(FOUND)]
    return {
        "all_median": float(single["removed_share"].median()),
        "all_mean": float(single["removed_share"].mean()),
        "all_count": len(single),
        "found_median": float(hits["removed_share"].median()),
        "found_mean": float(hits["removed_share"].mean()),
        "found_count": len(hits),
    }


def times(table: pd.DataFrame) -> dict[str, float]:
    """Wall-clock seconds of the command, start of the interpreter included."""
    seconds = table["seconds"].to_numpy(dtype=float)
    seconds = seconds[np.isfinite(seconds)]
    if not len(seconds):
        return {"median": float("nan"), "p90": float("nan"), "largest": float("nan")}
    return {
        "median": float(np.median(seconds)),
        "p90": float(np.quantile(seconds, 0.9)),
        "largest": float(seconds.max()),
    }


def confusion(table: pd.DataFrame) -> pd.DataFrame:
    """Categories by outcomes, counts; outcomes that never came are left out."""
    columns = [o for o in OUTCOMES if (table["outcome"] == o).any()]
    counts = pd.crosstab(table["category"], table["outcome"]).reindex(columns=columns, fill_value=0)
    order = [c for c in ("single", "pair", "beyond", "unexcited", "none", "drift", "fault") if c in counts.index]
    return counts.reindex(order)


def mistaken(table: pd.DataFrame) -> pd.DataFrame:
    """Truth and what was said instead, counts, most frequent first."""
    wrong = table[table["outcome"].isin(["wrong_name", "wrong_class", "false_alarm"])]
    if wrong.empty:
        return pd.DataFrame(columns=["category", "truth", "said", "count"])
    counts = wrong.groupby(["category", "truth", "said"]).size().reset_index(name="count")
    return counts.sort_values(["count", "truth"], ascending=[False, True], ignore_index=True)


def as_json(table: pd.DataFrame) -> dict[str, Any]:
    """Everything a summary says."""
    all_rates = rates(table)
    return {
        "records": len(table),
        "rates": [{**asdict(r), "share": r.share} for r in all_rates],
        "removed_share": removal(table),
        "seconds": times(table),
        "confusion": {str(k): {str(o): int(n) for o, n in row.items()} for k, row in confusion(table).iterrows()},
        "mistaken": mistaken(table).to_dict(orient="records"),
    }
