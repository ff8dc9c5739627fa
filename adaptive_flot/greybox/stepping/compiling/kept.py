"""How many compiled functions are kept: those used last, so that the user's cache folder does not grow for ever.

A search compiles some hundred structures of a model, of which a later one on the same record uses most again. Each is
some 25 kB.
"""

from __future__ import annotations

import os
from contextlib import suppress
from functools import cache
from pathlib import Path

MOST, LEFT = 5000, 4000
"""Libraries from which some are deleted, and how many are left then: some 100 MB."""


def used(library: Path) -> None:
    """Note that a library is used: the time of its file says when it was last."""
    with suppress(OSError):  # it may be another's, or gone
        os.utime(library)


def tidy(folder: Path, most: int = MOST, left: int = LEFT) -> None:
    """Delete the libraries of a folder that were not used for longest, where there are too many.

    Only once in each process: looking at all of them takes a while. One that is loaded stays loaded, and a process that
    misses one compiles it again.
    """
    _tidy(folder, most, left, os.getpid())


@cache
def _tidy(folder: Path, most: int, left: int, process: int) -> None:
    found: list[tuple[float, str]] = []
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.endswith(".so"):
                with suppress(OSError):  # another process tidies as well
                    found.append((entry.stat(follow_symlinks=False).st_mtime, entry.path))
    if len(found) <= most:
        return
    for _, path in sorted(found)[:-left]:
        with suppress(OSError):
            os.unlink(path)
