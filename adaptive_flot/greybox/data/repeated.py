"""Rows that a logger has written again: it held its last values, or a part of the record was pasted twice."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

BoolArray = np.ndarray[Any, np.dtype[np.bool_]]

LONGEST_BY_CHANCE = 10
"""Fewer rows in a row may be equal to earlier ones by chance, where a signal is fine enough."""
FINE = 0.5
"""A noisy column has so large a share of values that differ from all others: then equal rows are no chance."""
TURNING = 0.2
"""Share of the rows at which a noisy signal turns, at least: two thirds where it is white, none where it is smooth."""


def repeated_rows(table: pd.DataFrame, time: str) -> BoolArray:
    """Mask (N,) of rows that repeat earlier ones in every column, at least LONGEST_BY_CHANCE after one another.

    A run repeats either the row before it (values that were held) or as many rows from elsewhere, in their order. This
    can only be told where a signal is noisy: one without noise may come to rest. One noisy signal that is held is a
    sensor that has stopped, and nothing is wrong with the others. A row in which no noisy signal has a value repeats
    nothing: it is a hole in the measurements, and the record goes on behind it.
    """
    none = np.zeros(len(table), dtype=bool)
    numbers = table.drop(columns=time, errors="ignore").select_dtypes("number")
    noisy = [c for c in numbers.columns if _is_noisy(numbers[c].dropna().to_numpy())]
    if not noisy or len(table) < 2 * LONGEST_BY_CHANCE:
        return none
    codes = np.asarray(numbers.groupby(list(numbers.columns), dropna=False, sort=False).ngroup(), dtype=np.int64)
    before = np.where(numbers[noisy].notna().any(axis=1), _last_place(codes), -1)
    goes_on = (before[1:] >= 0) & (before[:-1] >= 0) & (np.diff(before) == 1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], goes_on.astype(int), [0]])))
    for start, end in zip(edges[::2], edges[1::2] + 1, strict=True):
        held = before[end - 1] == end - 2
        if end - start >= LONGEST_BY_CHANCE and (len(noisy) > 1 or not held):
            none[start:end] = True
    return none


def _is_noisy(values: np.ndarray[Any, np.dtype[Any]]) -> bool:
    """Whether values differ from all others, and turn as often as noise does: a smooth signal may come to rest."""
    if len(values) < LONGEST_BY_CHANCE or len(np.unique(values)) <= FINE * len(values):
        return False
    steps = np.diff(values)
    return bool(np.mean(steps[1:] * steps[:-1] < 0) > TURNING)


def _last_place(codes: np.ndarray[Any, np.dtype[np.int64]]) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Place (N,) of the last row before with the same code; -1 where there is none."""
    order = np.argsort(codes, kind="stable")
    same = np.concatenate([[False], codes[order][1:] == codes[order][:-1]])
    place = np.full(len(codes), -1, dtype=np.int64)
    place[order[same]] = order[np.flatnonzero(same) - 1]
    return place
