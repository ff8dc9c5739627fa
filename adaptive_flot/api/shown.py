"""Tables as notebooks show them; the kinds of a plot."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import TYPE_CHECKING

import pandas as pd

from adaptive_flot.errors import ResultError, near_match

if TYPE_CHECKING:  # a simulation has no use for discovery
    from adaptive_flot.discovery.results import Verdict


def text_of(title: str, table: pd.DataFrame) -> str:
    """A heading and a table, as text."""
    return f"{title}\n{table.to_string(index=False, float_format=_number)}" if len(table) else title


def html_of(title: str, table: pd.DataFrame) -> str:
    """A heading and a table, as HTML."""
    shown = table.to_html(index=False, border=0, float_format=_number) if len(table) else ""
    return f"<div><p><strong>{escape(title)}</strong></p>{shown}</div>"


def error_table(verdict: Verdict, level: str) -> pd.DataFrame:
    """Error of each output before and after, a row an output; `level` heads what the error is compared with."""
    rows = [
        {
            "output": c.output,
            "unit": c.unit,
            "before": c.before,
            "after": c.after,
            level: c.noise,
            "reduction_low_pct": 100 * c.reduction95[0],
            "reduction_high_pct": 100 * c.reduction95[1],
        }
        for c in verdict.error
    ]
    return pd.DataFrame(rows)


def check_kind(kind: str, known: Iterable[str]) -> None:
    """Refuse a plot that a result does not have.

    Raises
    ------
    ResultError
        Unknown kind; the message holds those that there are.
    """
    kinds = list(known)
    if kind not in kinds:
        raise ResultError(f"plot: no kind {kind!r} here; {near_match(kind, kinds)}")


def _number(value: float) -> str:
    return f"{value:.0f}" if 1e4 <= abs(value) < 1e9 else f"{value:.4g}"
