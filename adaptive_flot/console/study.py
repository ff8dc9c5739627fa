"""What `sweep` prints at its end."""

from __future__ import annotations

import pandas as pd

from adaptive_flot.console.lines import standard_output
from adaptive_flot.console.tables import print_table
from adaptive_flot.report.kit.parts import Table

TITLE = "Fit in percent: median [5 %, 95 %] over the seeds"
MOST_MESSAGES = 3
"""Reasons of failures that are printed, the most frequent first."""


def print_study(table: pd.DataFrame) -> None:
    """Print the distribution of each fit by scenario, controller and estimator, then the failed runs."""
    fits = [c for c in map(str, table.columns) if c.startswith("fit_") and table[c].notna().any()]
    keys = ["scenario", "controller", "estimator"]
    same = [str(table[k].iloc[0]) for k in keys[:2] if table[k].nunique() == 1]
    keys = [k for k in keys if k == "estimator" or table[k].nunique() > 1]
    rows = []
    for names, part in table.groupby(keys, sort=False):
        failed = int((part["outcome"] == "failed").sum())
        rows.append((*map(str, names), str(len(part)), str(failed), *(_distribution(part[c]) for c in fits)))
    header = (*map(str.capitalize, keys), "Runs", "Failed", *(c.removeprefix("fit_") for c in fits))
    console = standard_output()
    print_table(
        console, Table("", header, tuple(rows), words=len(keys)), f"{TITLE} ({', '.join(same)})" if same else TITLE
    )
    messages = table.loc[table["outcome"] == "failed", "message"].value_counts()
    for message, count in messages.head(MOST_MESSAGES).items():
        console.print(f"{count} failed: {message}", highlight=False)
    if len(messages):
        console.print("Run failed ones again with --retry-failed.", highlight=False)
    console.file.flush()


def _distribution(values: pd.Series[float]) -> str:
    finite = values.dropna()
    if finite.empty:
        return ""
    low, median, high = finite.quantile([0.05, 0.5, 0.95])
    return f"{median:.2f} [{low:.2f}, {high:.2f}]"
