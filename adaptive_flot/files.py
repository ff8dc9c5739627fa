"""Write files whole or not at all: an interrupt never leaves a broken result."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from adaptive_flot.errors import OutputError


def check_writable(path: Path, where: str) -> None:
    """Check that a file could be written, before the work whose result it will hold. Nothing is made or changed.

    Parameters
    ----------
    path
        The file; folders above it that do not exist are made when it is written.
    where
        Option that named it, for the message.

    Raises
    ------
    OutputError
        A folder, a device or a write-protected file has that name, a file stands where a folder must be, or the
        folder takes no files.
    """
    try:
        if path.is_dir():
            raise OutputError(f"{where}: {path} is a folder; give the name of a file")
        if path.exists() and not path.is_file():
            raise OutputError(f"{where}: {path} is no regular file; give another path")
        if path.exists() and not os.access(path, os.W_OK):
            raise OutputError(f"{where}: {path} is write-protected; give another path")
        folder = next(parent for parent in path.absolute().parents if parent.exists())
        if not folder.is_dir():
            raise OutputError(f"{where}: {path} can not be written ({folder} is a file); give another path")
        with tempfile.TemporaryFile(dir=folder):
            pass
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise OutputError(f"{where}: {path} can not be written ({reason}); give another path") from error


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
