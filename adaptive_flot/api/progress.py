"""What a terminal shows while a call works; the libraries for it are loaded only where it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def counted(shown: bool, label: str, total: int) -> Iterator[Callable[[], None]]:
    """Yield a function to call after each of `total` parts: it advances a bar if that is to be shown."""
    if not shown:
        yield lambda: None
        return
    from adaptive_flot.console.lines import progress_bar

    with progress_bar(label, total) as advance:
        yield advance


@contextmanager
def staged(shown: bool, label: str) -> Iterator[Callable[[str], None]]:
    """Yield a function to call with the word for each stage: it shows the word if that is to be shown."""
    if not shown:
        yield lambda stage: None
        return
    from adaptive_flot.console.lines import stage_bar

    with stage_bar(label) as progress:
        yield progress
