"""Where the measured records are: beside the checkout, and no part of it."""

from __future__ import annotations

import sys
from pathlib import Path

SHARED = Path(__file__).parents[2].parent / "shared" / "data"


def has_records(folder: Path) -> bool:
    """Whether a folder holds the measured records; says so in one line where it does not."""
    there = (folder / "air-handling-unit").is_dir()
    if not there:
        print(f"no measured records in {folder}; give the folder that holds them", file=sys.stderr)
    return there
