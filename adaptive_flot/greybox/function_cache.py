"""Values that are costly to make, each made once and kept while it is in use."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from typing import Any, Generic, TypeVar

Value = TypeVar("Value")

MOST_KEPT = 256
"""Entries of a cache. A model needs some ten; records of every length need two for each of the 64 row counts."""
MOST_WRITTEN = 2_000_000
"""Characters of the equations of all models whose functions a thread keeps: 200 small ones, or 25 flotation cells.

A discovery comes to a few hundred models, and to most of them several times. The functions of a cell take some 4 MB.
"""


class FunctionCache(Generic[Value]):
    """A cache that drops the entry not used for longest, so that its memory stays bounded.

    A copy or pickle of it is empty: compiled functions belong to one process, and each can be made again.

    Parameters
    ----------
    most
        Number of entries kept, or the size of all of them together.
    """

    def __init__(self, most: int = MOST_KEPT) -> None:
        self._most = most
        self._values: dict[Hashable, Value] = {}  # in the order of use, the latest last
        self._sizes: dict[Hashable, int] = {}
        self._total = 0

    def __len__(self) -> int:
        return len(self._values)

    def get(self, key: Hashable, make: Callable[[], Value], size: int = 1) -> Value:
        """Value of a key; `make` is called when the cache does not hold it. The latest is kept whatever its size."""
        value = self._values.pop(key) if key in self._values else make()
        self._values[key] = value
        self._total += size - self._sizes.pop(key, 0)
        self._sizes[key] = size
        while self._total > self._most and len(self._values) > 1:
            oldest = next(iter(self._values))
            del self._values[oldest]
            self._total -= self._sizes.pop(oldest)
        return value

    def __reduce__(self) -> tuple[type[FunctionCache[Value]], tuple[int]]:
        return FunctionCache, (self._most,)


_of_thread = threading.local()


def functions_of(content: Hashable, size: int) -> FunctionCache[Any]:
    """The cache of all models with this content that a thread has made; `size` is the number of its characters.

    A search attaches the same effect at many places of its course, each time to a model of its own. What the models
    are equal in, `content` tells; then their functions are. Functions with buffers are not for two threads at once.
    """
    if not hasattr(_of_thread, "caches"):
        _of_thread.caches = FunctionCache(MOST_WRITTEN)
    caches: FunctionCache[FunctionCache[Any]] = _of_thread.caches
    return caches.get(content, FunctionCache, size)


def forget_functions() -> None:
    """Models made from now on by this thread share nothing with those before: another compiler, say, is at hand."""
    _of_thread.__dict__.clear()
