"""Whether a file is this user's own: what is loaded as code must not have been put there by somebody else."""

from __future__ import annotations

import os
import stat
from itertools import islice
from pathlib import Path

WRITABLE = stat.S_IWGRP | stat.S_IWOTH


def make_private(folder: Path) -> None:
    """Make a folder and those above it that are missing; nobody else may write to them.

    Raises
    ------
    OSError
        It can not be made.
    """
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    for path in reversed(missing):
        path.mkdir(mode=0o700, exist_ok=True)


def problem_of(file: Path, levels: int) -> str | None:
    """Why a file can not be trusted, in one line; None where only this user (or root) can have written it.

    The file and so many folders above it must belong to this user or to root, and nobody else may write to them. A
    folder in which each user may remove only his own files (the sticky bit) is no danger. A link is followed for the
    folders and refused for the file.

    Parameters
    ----------
    file
        The file.
    levels
        Folders above it that are checked.
    """
    if not hasattr(os, "geteuid"):
        return None
    folder = file.parent.resolve()
    for path in (folder / file.name, *islice((folder, *folder.parents), levels)):
        try:
            found = path.lstat()
        except OSError as error:
            return f"{path}: can not be read ({error.strerror or error})"
        is_folder = stat.S_ISDIR(found.st_mode)
        if not (is_folder or stat.S_ISREG(found.st_mode)):
            return f"{path}: a link or device, no file; it is not loaded: remove it"
        if found.st_uid not in (os.geteuid(), 0):
            return (
                f"{path}: belongs to another user (number {found.st_uid}), so nothing is loaded from there: remove it"
            )
        if found.st_mode & WRITABLE and not (is_folder and found.st_mode & stat.S_ISVTX):
            mode = stat.S_IMODE(found.st_mode)
            return f"{path}: others may write to it (mode {mode:o}), so nothing is loaded from there: remove it"
    return None
