"""Write files whole or not at all: an interrupt never leaves a broken result."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from adaptive_flot.errors import OutputError


@contextmanager
def replace_path(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; it takes its place when the block ends without an error.

    Raises
    ------
    OutputError
        The file can not be written there.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=".adaptive-flot-", suffix=path.suffix, dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            temporary.chmod(0o644)
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"{path}: can not be written ({error.strerror or error}); give another path") from error


@contextmanager
def replace_file(path: Path) -> Iterator[IO[str]]:
    """Yield a text stream whose content takes the place of `path` when the block ends without an error."""
    with replace_path(path) as temporary:
        with temporary.open("w", encoding="utf-8") as stream:
            yield stream


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all."""
    with replace_file(path) as stream:
        stream.write(text)
