"""Runs whose time series the tests change."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd

from adaptive_flot.runner.commands.runs.run_result import Run


def with_table(run: Run, table: pd.DataFrame) -> Run:
    """The run with another table of time series."""
    changed = replace(run)
    changed.__dict__["table"] = table  # where the table is kept once it is made
    return changed
