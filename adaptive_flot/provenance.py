"""What made a result: version, commit, and hashes of what was read."""

from __future__ import annotations

import hashlib
import subprocess
from collections.abc import Iterable
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from adaptive_flot.greybox.quantities import FloatArray

HASH_DIGITS = 16
_ROOT = Path(__file__).parents[1]


@cache
def package_version() -> str:
    """Version of this package."""
    try:
        return version("adaptive-flot")
    except PackageNotFoundError:  # run from a source tree that is not installed
        return "not installed"


@cache
def commit() -> str:
    """Commit of the source tree that runs, with "-dirty" where files differ from it; "" where it is no repository."""
    here = Path(__file__)
    if _git("ls-files", "--error-unmatch", str(here)) is None:  # a repository that only happens to lie around it
        return ""
    return _git("describe", "--always", "--dirty", "--exclude=*") or ""


def code() -> str:
    """Version and commit in one: "0.1.0, commit 1a2b3c4"."""
    made = commit()
    return f"{package_version()}, commit {made}" if made else package_version()


def file_hash(path: Path) -> str:
    """First digits of the SHA-256 of a file, as `sha256sum` prints it; "" where it can not be read."""
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()[:HASH_DIGITS]
    except OSError:
        return ""


def hashed(files: Iterable[Path]) -> list[tuple[str, str]]:
    """(what, name and hash) of each file that can be read, for the foot of a page; of one name with their folder."""
    known = [(file, digits) for file in dict.fromkeys(files) if (digits := file_hash(file))]
    names = [file.name for file, _ in known]
    shown = [f"{f.parent.name}/{f.name}" if names.count(f.name) > 1 and f.parent.name else f.name for f, _ in known]
    return [(f"SHA-256 of {name}", f"{digits} …") for name, (_, digits) in zip(shown, known, strict=True)]


def values_hash(arrays: Iterable[FloatArray]) -> str:
    """First digits of the SHA-256 of the values of a record, wherever they came from: the same values, the same hash.

    >>> values_hash([np.zeros(2)]) == values_hash([np.zeros(2)]) != values_hash([np.ones(2)])
    True
    """
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(np.ascontiguousarray(array, dtype="<f8").tobytes())
    return f"{digest.hexdigest()[:HASH_DIGITS]} …"


def now() -> str:
    """Date and time in UTC, to the minute."""
    return datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")


def _git(*arguments: str) -> str | None:
    """Output of git in the source tree; None where there is no git, no repository, or it fails."""
    try:
        done = subprocess.run(
            ["git", "-C", str(_ROOT), *arguments], capture_output=True, text=True, timeout=10, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()
