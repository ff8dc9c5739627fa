"""Rivals on the same records, each as a user would write it in an afternoon. They write the same verdict JSON."""

from __future__ import annotations

import json
import time
from pathlib import Path

from adaptive_flot.errors import DataError, near_match
from adaptive_flot.files import write_text

RIVALS = ("correlation", "bic", "drift", "spline", "oracle")


def judge(name: str, record: Path, out: Path, answer: Path | None = None) -> None:
    """Judge a record and write the verdict.

    Raises
    ------
    DataError
        No rival of that name, or the oracle without an answer.
    """
    from benchmarks.hidden_effects.rivals import base, bic, correlation, drift, oracle, spline

    if name not in RIVALS:
        raise DataError(f"{name}: no such rival; {near_match(name, RIVALS)}")
    begun = time.perf_counter()
    if name == "oracle":
        if answer is None:
            raise DataError("oracle: needs --answer, the file of the record's answer")
        verdict = oracle.judge(record, answer)
    elif name == "drift":  # it asks for no candidates
        verdict = drift.judge(base.fitted(record))
    else:
        methods = {"correlation": correlation.judge, "bic": bic.judge, "spline": spline.judge}
        verdict = methods[name](base.prepared(record))
    verdict["seconds"] = round(time.perf_counter() - begun, 3)
    write_text(out, json.dumps(verdict, indent=1) + "\n")
