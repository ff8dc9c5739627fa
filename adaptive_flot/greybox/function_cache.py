"""Values that are costly to make, each made once and kept while it is in use."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from typing import Any, Generic, TypeVar

Value = TypeVar("Value")

MOST_KEPT = 256
"""Entries of a cache. A model needs some ten; records of every length need two for each of the 64 row counts."""
MOST_MODELS = 192
"""Models whose functions a thread keeps. A discovery comes to a few hundred, and to most of them several times."""


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


_of_thread = threading.local()


def functions_of(content: Hashable) -> FunctionCache[Any]:
    """The cache of all models with this content that a thread has made.

    A search attaches the same effect at many places of its course, each time to a model of its own. What the models
    are equal in, `content` tells; then their functions are. Functions with buffers are not for two threads at once.
    """
    if not hasattr(_of_thread, "caches"):
        _of_thread.caches = FunctionCache(MOST_MODELS)
    caches: FunctionCache[FunctionCache[Any]] = _of_thread.caches
    return caches.get(content, FunctionCache)


def forget_functions() -> None:
    """Models made from now on by this thread share nothing with those before: another compiler, say, is at hand."""
    _of_thread.__dict__.clear()
