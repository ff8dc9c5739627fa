"""Outcome of each verdict, and the figures, as in `benchmarks.plant_like`.

What a plant has on every record and its model has not is no wrong name: it is struck from what was said first.
"""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
from scipy.stats import binomtest

from benchmarks.hidden_effects.score.verdict import Name, SubmittedVerdict, read_verdict
from benchmarks.plant_like.score import TOLD, outcome

WRONG = ("wrong_name", "wrong_class", "false_alarm")


def results(folder: Path, label: str) -> pd.DataFrame:
    """One row a record that was judged."""
    rows = []
    for file in sorted((folder / "runs" / label / "verdicts").glob("*.meta.json")):
        name, meta = file.name.removesuffix(".meta.json"), json.loads(file.read_text())
        answer = json.loads((folder / "answers" / f"{name}.json").read_text())
        verdict = read_verdict(file.with_name(f"{name}.json"))
        ended = {"refused": "abstained", "timeout": "timeout"}.get(meta["status"], "failed")
        said: list[Name] = []
        if isinstance(verdict, SubmittedVerdict) and meta["status"] == "ok":
            said = verdict.members if verdict.verdict == "class" else verdict.effects
            ended = outcome(answer, verdict)
        rows.append({
            "record": name,
            "process": answer["process"],
            "case": answer["case"],
            "truth": "+".join(f"{e['site']}:{e['driver']}" for e in answer["effects"]),
            "size": round(max(answer["size"].values(), default=0.0), 1),
            "reference": "yes" if answer["reference"] else "",
            "verdict": verdict if isinstance(verdict, str) else verdict.verdict,
            "said": "+".join(f"{n.site}:{n.driver}" for n in said),
            "outcome": ended,
            "seconds": meta["seconds"],
        })  # fmt: skip
    return pd.DataFrame(rows)


def figures(table: pd.DataFrame) -> pd.DataFrame:
    """Shares with their 95 % intervals (Clopper and Pearson), and times."""
    hidden = table[table.truth != ""]
    parts = {
        "told, records with an effect": hidden.outcome.isin(TOLD),
        "wrong name, all records": table.outcome.isin(WRONG) & (table.verdict == "named"),
        "wrong name or class, all records": table.outcome.isin(WRONG),
        "no answer (crash, timeout), all records": table.outcome.isin(("failed", "timeout")),
    }
    rows = []
    for name, hits in parts.items():
        test = binomtest(int(hits.sum()), max(len(hits), 1)).proportion_ci(0.95)
        shares = (100 * v for v in (hits.mean(), test.low, test.high))
        rows.append((name, f"{hits.sum()} of {len(hits)}", "{:.0f} % [{:.0f}, {:.0f}]".format(*shares)))
    rows.append(("seconds, median and largest", f"{table.seconds.median():.0f}", f"{table.seconds.max():.0f}"))
    return pd.DataFrame(rows, columns=["figure", "count", "share"])


def by_process(table: pd.DataFrame) -> pd.DataFrame:
    """Number of each outcome by process."""
    return pd.crosstab(table["process"], table["outcome"]).reset_index()
