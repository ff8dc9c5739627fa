"""Sizes of constants that are named rightly: how far off they are, and whether their 95 % interval holds the truth.

Where a constant is wrong on every record as well, the truth is both factors together. With the relative changes a of
the effect and b of the background, the logarithm that a verdict tells is::

    log(1 + a) + log(1 + b)
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

FACTORS = ("level", "gain")
"""Shapes that are a factor of the constant."""


def sizes(folder: Path, label: str) -> pd.DataFrame:
    """One row for each constant that was named rightly: size told over the true one less one, and whether it holds."""
    rows = []
    for file in sorted((folder / "answers").glob("record_*.json")):
        answer, told = json.loads(file.read_text()), folder / "runs" / label / "verdicts" / file.name
        verdict: dict[str, Any] = {"verdict": ""}
        if told.is_file():
            verdict = json.loads(told.read_text())
        for effect in answer["effects"]:
            name = effect["site"], effect["driver"]
            if verdict["verdict"] != "named" or name[1] != "constant" or effect["shape"] not in FACTORS:
                continue
            true = float(np.log1p(effect["amplitude"]) + np.log1p(answer["background"].get(name[0], 0.0)))
            for said in (e for e in verdict["effects"] if (e["site"], e["driver"]) == name):
                low, high = said["interval95"]["amplitude"]
                off = float(np.expm1(said["coefficients"]["amplitude"] - true))
                rows.append({"record": file.stem, "site": name[0], "off": off, "held": low <= true <= high})
    return pd.DataFrame(rows, columns=["record", "site", "off", "held"])


def size_words(table: pd.DataFrame) -> str:
    """The table in one line."""
    if table.empty:
        return "sizes of named constants: none"
    off = table.off.abs()
    return (
        f"sizes of {len(table)} named constants: off by {off.median():.1%} in the middle, {off.max():.1%} at most; "
        f"{int(table.held.sum())} of {len(table)} intervals of 95 % hold the truth"
    )
