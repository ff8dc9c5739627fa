"""One row a record: truth, verdict, outcome, error removed, time."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pandas as pd

from adaptive_flot.files import replace_file
from benchmarks.hidden_effects.generate.folder import load_answers
from benchmarks.hidden_effects.generate.record import BIN
from benchmarks.hidden_effects.score.outcome import Answer, classify, effects_told
from benchmarks.hidden_effects.score.verdict import SubmittedVerdict, read_verdict

UNDECIDED = ("abstain", "insufficient")
"""Verdicts that stand for no model: the error that one writes beside them is that of a model which nobody is given."""
REMOVABLE = 1.5  # base error over oracle error on the report block, from which there is something to remove


def main_output(answer: Answer) -> str | None:
    """Output with most to remove on the report block; None where no output has anything to remove."""
    ratio = {
        name: answer["base_error"][name]["report"] / max(answer["oracle_error"][name]["report"], 1e-15)
        for name in answer["base_error"]
    }
    ratio = {name: r for name, r in ratio.items() if math.isfinite(r)}
    if not ratio:
        return None
    # The grade is what the model is for: it counts wherever it has something to remove.
    if ratio.get("concentrate_grade", 0.0) >= REMOVABLE:
        return "concentrate_grade"
    name = max(ratio, key=ratio.__getitem__)
    return name if ratio[name] >= REMOVABLE else None


def removed_share(answer: Answer, verdict: SubmittedVerdict | None) -> float:
    """Error removed on held-out rows as a share of an oracle's, in the output with most to remove.

    The rows are those the verdict says it kept for its report, else the last 20 %. The base and the oracle are the
    benchmark's own, on these rows; of the verdict only `error.<output>.after` is used. Nothing was removed (0) without
    a verdict, without its error, or by one that decides nothing. NaN where there is nothing to remove. Not
    above 1, not below -1.
    """
    name = main_output(answer)
    if name is None:
        return math.nan
    if verdict is None or verdict.verdict in UNDECIDED:
        return 0.0
    block = verdict.error.get(name)
    if block is None or block.after is None or not math.isfinite(block.after):
        return 0.0
    base, oracle = _held_out(answer, verdict, name)
    if not base > oracle:
        return math.nan
    return max(-1.0, min(1.0, float((base - block.after) / (base - oracle))))


def _held_out(answer: Answer, verdict: SubmittedVerdict, output: str) -> tuple[float, float]:
    """Root mean square error of base and oracle on the rows that a verdict kept for its report."""
    squares = answer.get("squares", {}).get(output)
    if not (verdict.report_times_s and squares):
        return answer["base_error"][output]["report"], answer["oracle_error"][output]["report"]
    inside = [
        any(first <= k * BIN + 1 and (k + 1) * BIN <= last for first, last in verdict.report_times_s)
        for k in range(len(squares["rows"]))
    ]
    rows, base, oracle = (
        sum(v for v, i in zip(squares[key], inside, strict=True) if i) for key in ("rows", "base", "oracle")
    )
    return (math.sqrt(base / rows), math.sqrt(oracle / rows)) if rows else (math.nan, math.nan)


def result_row(answer: Answer, verdict: SubmittedVerdict | str, meta: dict[str, Any]) -> dict[str, Any]:
    """One row; `meta` tells how the command ended (status, seconds)."""
    status = meta.get("status", "ok")
    readable = verdict if isinstance(verdict, SubmittedVerdict) and status == "ok" else None
    if readable is None:
        outcome = {"timeout": "timeout", "refused": "abstained"}.get(status, "failed")
        if status == "refused" and "insufficient" in answer["right_verdicts"]:
            outcome = "right"
    else:
        outcome = classify(answer, readable)
    said = [] if readable is None else (readable.members if readable.verdict == "class" else readable.effects)
    return {
        "record": answer["record"],
        "category": answer["category"],
        "truth": "+".join(f"{e['site']}:{e['driver']}" for e in answer["effects"]) or answer["note"],
        "ordinary": answer["ordinary"],
        "size": max(answer["size"].values(), default=0.0),
        "loop": answer["loop"],
        "noise": answer["noise"]["kind"],
        "verdict": readable.verdict if readable else status,
        "said": "+".join(f"{n.site}:{n.driver}" for n in said),
        "outcome": outcome,
        "effects_told": 0 if readable is None else effects_told(answer, readable),
        "removed_share": removed_share(answer, readable),
        "output": main_output(answer) or "",
        "seconds": meta.get("seconds", math.nan),
        "problem": verdict if isinstance(verdict, str) else "",
    }


def results_table(folder: Path, label: str, count: int | None = None) -> pd.DataFrame:
    """Results of a run so far; records without a verdict yet are left out."""
    rows = []
    run = folder / "runs" / label
    for name, answer in load_answers(folder, count).items():
        meta = run / "verdicts" / f"{name}.meta.json"
        if meta.is_file():
            verdict = read_verdict(run / "verdicts" / f"{name}.json")
            rows.append(result_row(answer, verdict, json.loads(meta.read_text())))
    return pd.DataFrame(rows)


def write_results(folder: Path, label: str, table: pd.DataFrame) -> Path:
    """Write the rows beside the verdicts."""
    path = folder / "runs" / label / "results.csv"
    with replace_file(path) as stream:
        table.to_csv(stream, index=False, float_format="%.4g", lineterminator="\n")
    return path
