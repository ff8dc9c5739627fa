"""Values that are costly to make, each made once and kept while it is in use."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

Value = TypeVar("Value")

MOST_KEPT = 256
"""Entries of a cache. A model needs some ten; records of every length need two for each of the 64 row counts."""


class FunctionCache(Generic[Value]):
    """A cache that drops the entry not used for longest, so that its memory stays bounded.

    A copy or pickle of it is empty: compiled functions belong to one process, and each can be made again.

    Parameters
    ----------
    most
        Number of entries kept.
    """

    def __init__(self, most: int = MOST_KEPT) -> None:
        self._most = most
        self._values: dict[Hashable, Value] = {}  # in the order of use, the latest last

    def __len__(self) -> int:
        return len(self._values)

    def get(self, key: Hashable, make: Callable[[], Value]) -> Value:
        """Value of a key; `make` is called when the cache does not hold it."""
        value = self._values.pop(key) if key in self._values else make()
        self._values[key] = value
        if len(self._values) > self._most:
            del self._values[next(iter(self._values))]
        return value

    def __reduce__(self) -> tuple[type[FunctionCache[Value]], tuple[int]]:
        return FunctionCache, (self._most,)
