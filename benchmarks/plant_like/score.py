"""Outcome of a verdict on a plant-like record, and the figures over all.

What is wrong on every record is no wrong name: wrong constants and the wandering feed are struck from what was said
first. The rest is held against the effect as in `benchmarks.hidden_effects.score.outcome`.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
from scipy.stats import binomtest

from benchmarks.hidden_effects.score.outcome import Answer, classify
from benchmarks.hidden_effects.score.verdict import Name, SubmittedVerdict, read_verdict

TOLD = ("right", "right_class", "right_place")
NAMES = ("named", "class")


def outcome(answer: Answer, verdict: SubmittedVerdict) -> str:
    """Outcome of one verdict."""
    background = {(t["site"], t["driver"]) for t in answer["tolerated"]}
    background -= {(e["site"], e["driver"]) for e in answer["effects"]}  # the same name: it is what is asked for
    effects = [n for n in verdict.effects if n.pair() not in background]
    members = [n for n in verdict.members if n.pair() not in background]
    said = members if verdict.verdict == "class" else effects
    if verdict.verdict in (*NAMES, "unnamed") and not said:  # a true name of what is wrong on every record
        return "tolerated"
    if verdict.verdict == "class" and len(members) < len(verdict.members) and not answer["effects"]:
        return "tolerated"
    ended = classify(answer, verdict.model_copy(update={"effects": effects, "members": members}))
    # a class says that one of its members is off: with one that is, it is true, though it tells nothing of the effect
    return "tolerated" if ended == "wrong_class" and len(members) < len(verdict.members) else ended


def results(
    folder: Path, label: str, told: Callable[[dict[str, Any]], dict[str, object]] = lambda a: {"loop": a["loop"]}
) -> pd.DataFrame:
    """One row a record that was judged; `told` says which further columns come from its answer."""
    rows = []
    for file in sorted((folder / "runs" / label / "verdicts").glob("*.meta.json")):
        name, meta = file.name.removesuffix(".meta.json"), json.loads(file.read_text())
        answer = json.loads((folder / "answers" / f"{name}.json").read_text())
        verdict = read_verdict(file.with_name(f"{name}.json"))
        ended = {"refused": "abstained"}.get(meta["status"], "failed")
        said: list[Name] = []
        if isinstance(verdict, SubmittedVerdict) and meta["status"] == "ok":
            said = verdict.members if verdict.verdict == "class" else verdict.effects
            ended = outcome(answer, verdict)
        rows.append({
            "record": name,
            "truth": "+".join(f"{e['site']}:{e['driver']}" for e in answer["effects"]),
            "size": round(max(answer["size"].values(), default=0.0), 2),
            **told(answer),
            "verdict": verdict if isinstance(verdict, str) else verdict.verdict,
            "said": "+".join(f"{n.site}:{n.driver}" for n in said),
            "outcome": ended,
            "seconds": meta["seconds"],
        })  # fmt: skip
    return pd.DataFrame(rows)


def figures(table: pd.DataFrame) -> pd.DataFrame:
    """Shares with their 95 % intervals (Clopper and Pearson), and times."""
    with_effect = table[table.truth != ""]
    wrong = table.outcome.isin(("wrong_name", "wrong_class", "false_alarm"))
    parts = {
        "told, records with an effect": with_effect.outcome.isin(TOLD),
        "wrong name, all records": table.outcome.isin(("wrong_name", "false_alarm")) & (table.verdict == "named"),
        "wrong name or class, all records": wrong,
        "abstained, records with an effect": with_effect.outcome == "abstained",
        "no answer (crash, timeout), all records": table.outcome == "failed",
    }
    rows = []
    for name, hits in parts.items():
        test = binomtest(int(hits.sum()), max(len(hits), 1)).proportion_ci(0.95)
        shares = (100 * v for v in (hits.mean(), test.low, test.high))
        rows.append((name, f"{hits.sum()} of {len(hits)}", "{:.0f} % [{:.0f}, {:.0f}]".format(*shares)))
    rows.append(("seconds, median and 95 %", f"{table.seconds.median():.0f}", f"{table.seconds.quantile(0.95):.0f}"))
    return pd.DataFrame(rows, columns=["figure", "count", "share"])
